"""Streets of a map as a scene: readers of OpenDRIVE, SUMO and OpenStreetMap, one geometry, lane network and builder."""
