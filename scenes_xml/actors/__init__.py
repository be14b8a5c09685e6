"""Actor models: vehicles and people as plain Mitsuba files, and the scripts that build them."""
