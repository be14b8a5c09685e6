"""Extracts of OpenStreetMap as street maps: roads by SUMO's netconvert, buildings and what stands beside the roads."""
