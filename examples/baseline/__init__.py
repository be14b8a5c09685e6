"""A baseline: detection on radar maps, radar points, and camera plus radar. See docs/baseline.md."""
