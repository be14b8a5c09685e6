"""Specifications of sensors, light and weather as plain frozen data."""
