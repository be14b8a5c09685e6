"""Parts that scenes are built from: each module returns meshes, `xml` writes them as a Mitsuba scene."""
