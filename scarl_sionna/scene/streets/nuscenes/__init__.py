"""The map expansion of nuScenes: its tables, and the street map that they are."""
