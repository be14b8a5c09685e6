"""Motion over time: trajectories, and the joints whose motion follows from them."""
