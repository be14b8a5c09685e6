"""Kinds of waveforms beside plain ramps, and the codes of those that have one."""
