"""Small applications on top of all packages: the demo and the preview of a scenario."""
