"""Actor models: vehicles and people as folders of Mitsuba files, or from a user's mesh."""
