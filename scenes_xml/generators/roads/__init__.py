"""Roads, the ground, tunnels and bridges, and what drives or walks along them."""
