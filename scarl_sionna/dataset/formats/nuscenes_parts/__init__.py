"""Parts of a nuScenes folder: constant tables, files of sensors, splits, CAN bus."""
