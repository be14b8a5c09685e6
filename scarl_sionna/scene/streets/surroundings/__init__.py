"""What stands beside a street where its file says nothing of it, by seed: kerbs, verges, furniture, trees, houses."""
