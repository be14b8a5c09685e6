"""Single antennas of an array: measured patterns, how each antenna is turned and polarised."""
