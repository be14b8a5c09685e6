"""Light of the optical twin: sky, sun, lamps, wet ground."""
