"""Coherent multipath by the image method, on the surfaces that Sionna RT's PathSolver finds."""
