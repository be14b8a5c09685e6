"""A simulator that others step: poses come from outside, sensors that are due go out."""
