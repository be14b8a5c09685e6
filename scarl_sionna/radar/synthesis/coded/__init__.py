"""Signals of waveforms with codes or data: symbols, coded ramps."""
