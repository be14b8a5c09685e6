"""Sionna RT's PathSolver: which surfaces paths touch, radio links at any carrier, and derivatives of its gains."""
