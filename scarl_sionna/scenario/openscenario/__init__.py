"""ASAM OpenSCENARIO XML 1.0 to 1.3: what decides motion is read, run and returned as smooth trajectories.

Its modules take a quarter of a second to import: they are imported where there is such a file.
"""

SUFFIX = ".xosc"
