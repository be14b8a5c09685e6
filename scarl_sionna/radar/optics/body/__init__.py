"""Meshes that scatter in the far field: their geometry made ready, their parts and materials."""
