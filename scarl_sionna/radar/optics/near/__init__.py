"""Physical optics in a scene, with spherical waves of every antenna."""
