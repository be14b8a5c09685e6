"""Several radars that work together: all their mono- and bistatic paths, raw data, and coherent images."""
