"""A roundabout of one lane with four arms, islands and zebra crossings."""
