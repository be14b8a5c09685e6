"""Triangle meshes, plane outlines, and parts that follow a surface."""
