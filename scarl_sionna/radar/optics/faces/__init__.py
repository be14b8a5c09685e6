"""What faces are besides flat and opaque: parts of a curved surface, and layers that let waves through."""
