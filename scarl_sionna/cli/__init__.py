"""The command line: argument parsing, progress and messages only."""

from .main import app

__all__ = ["app"]
