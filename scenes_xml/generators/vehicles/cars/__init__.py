"""Cars of all kinds: bodies with wheel arches and a glazed cabin, from a handful of measures."""
