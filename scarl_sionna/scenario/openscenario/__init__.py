"""ASAM OpenSCENARIO XML 1.0 to 1.3: what decides motion is read, run and returned as smooth trajectories."""
