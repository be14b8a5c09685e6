"""Bodies, postures and clothes."""
