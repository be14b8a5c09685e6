"""Materials and textures."""
