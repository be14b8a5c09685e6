"""A two-lane road tunnel with niches, jet fans, lamps and traffic in both directions."""
