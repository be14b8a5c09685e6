"""What a dataset holds, counted: objects, radar points, occlusion, weather; beside published figures, as a page."""
