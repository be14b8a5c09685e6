"""The radio as a sensor: channels to base stations and cars at the frame's instant."""
