"""The specification of a lidar."""
