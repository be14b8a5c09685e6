"""Baselines against other radars: which samples they hit, and what to put in their place."""
