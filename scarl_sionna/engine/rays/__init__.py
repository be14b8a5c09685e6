"""Rays against the triangles of a state, and float64 geometry of what they hit."""
