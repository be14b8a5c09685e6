"""The scene of a map: surfaces, marks, kerbs, ground, bridges, tunnels, objects, signs."""
