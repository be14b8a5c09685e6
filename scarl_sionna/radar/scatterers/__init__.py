"""Scattering centres: compiled from a mesh, or of 3GPP TR 38.901."""
