"""Trees, hedges, shrubs and grass."""
