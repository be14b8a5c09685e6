"""Street maps in ASAM OpenDRIVE 1.4 to 1.8: `reading`, `geometry`, the lane `network`, `building` of the scene."""
