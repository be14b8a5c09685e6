"""Physical optics on a scene: the patches of its meshes as paths."""
