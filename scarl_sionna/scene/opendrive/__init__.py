"""Street maps in ASAM OpenDRIVE 1.4 to 1.8: read (`read`), evaluated (`curves`, `road`), and built as a scene."""
