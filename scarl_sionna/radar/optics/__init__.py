"""Physical optics on triangle meshes by ray tubes: seen from the far field, and from antennas in a scene."""
