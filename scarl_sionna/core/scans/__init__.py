"""Results of sensors that scan, each line of sight at a time of its own."""
