"""Ground truth on radar data, and where paths lie in a range-Doppler map."""
