"""A crossing with traffic lights between tall façades in a town."""
