"""``python -m scarl_sionna.cli``."""

from . import app

app()
