"""Radars whose antenna turns: paths for blocks of a turn, the beam over them, the ramp of every azimuth."""
