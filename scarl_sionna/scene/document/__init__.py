"""From a scene's name or file to its checked description and the XML of its twins; loads no geometry."""
