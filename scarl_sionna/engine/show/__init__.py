"""A scene for people: from above, and in three dimensions."""
