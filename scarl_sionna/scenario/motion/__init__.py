"""From what a scenario states or a record holds to smooth trajectories."""
