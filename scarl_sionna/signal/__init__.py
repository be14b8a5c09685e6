"""Radar signal processing on plain arrays: noise, converter, range-Doppler maps, directions, detection.

No scene, no engine.
"""
