"""A scenario as plain data: its parts, its files with line numbers, and the errors found in them."""
