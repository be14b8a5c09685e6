"""Road networks of SUMO (``.net.xml``) as street maps: what the file says, smooth lines, roads and ways."""
