"""Sionna RT's PathSolver: which surfaces paths touch, and derivatives of its gains."""
