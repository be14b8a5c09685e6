"""Directions from the phases of the virtual array, one or several in a cell."""
