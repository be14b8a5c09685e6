"""Points of roads: reference lines, cross-sections, borders of lanes."""
