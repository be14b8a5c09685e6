"""Things that stand beside roads: signs, lamps, traffic lights, fences, poles."""
