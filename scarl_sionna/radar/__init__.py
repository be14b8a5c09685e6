"""Radar: propagation paths from a scene, the raw data that they make, and ground truth on both."""
