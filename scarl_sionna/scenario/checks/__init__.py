"""Whether a scenario can be: motions, collisions, and what its file states."""
