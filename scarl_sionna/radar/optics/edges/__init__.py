"""Edge diffraction: what the currents near an edge radiate beyond those of physical optics."""
