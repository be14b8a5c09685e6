"""Exporters to the formats that people use, one a file."""
