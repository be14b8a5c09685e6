"""A town street with a zebra crossing, parked cars and people on foot."""
