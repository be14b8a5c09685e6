"""Radars whose antenna turns: what they are, and some by name."""
