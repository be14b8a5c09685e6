"""Radars that give no raw data: what a point looks like in their maps stands for their waveform and processing."""
