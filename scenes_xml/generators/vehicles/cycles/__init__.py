"""Generators of two-wheelers."""
