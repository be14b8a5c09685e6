"""Recordings of published datasets, one dataset a file."""
