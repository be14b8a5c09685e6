"""Traffic: simulated here, by SUMO, or read from records."""
