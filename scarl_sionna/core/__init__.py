"""Plain data and mathematics shared by every part: units, errors, poses, seeds, specs and results.

Nothing here imports Mitsuba, Sionna or Dr.Jit.
"""
