"""Lanes to drive on: links, right of way, traffic lights."""
