"""A place as data, without the engine: its document, actors, motion, lanes and materials."""
