"""From an OpenDRIVE file to plain data: errors and what is not used with their lines."""
