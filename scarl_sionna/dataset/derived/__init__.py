"""What is computed from stored frames: boxes, lidar and radar points."""
