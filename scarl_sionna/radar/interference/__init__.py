"""Other radars in the raw data of a radar."""
