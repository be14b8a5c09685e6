"""The scene `roundabout`."""
