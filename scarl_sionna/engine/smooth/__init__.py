"""The curved surfaces for which meshes of flat facets stand."""
