"""Runs a storyboard: conditions, actions and what they do to the motion of each entity."""
