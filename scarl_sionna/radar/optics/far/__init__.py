"""Shooting and bouncing rays with physical optics on a triangle mesh, in the far field.

`body` holds the mesh, `caster` asks the engine what a ray meets, `tubes` cuts ray tubes (`tube_shape`) until each one lies on one plane,
`trace` follows them from bounce to bounce, `surface` reflects their fields and `solve` sums what they radiate.
"""

from __future__ import annotations

from .body import Body
from .settings import DEFAULT_SBR, SbrSettings
from .solve import Looks, scattering_matrices
from .surface import PartSurfaces, Surface

__all__ = ["DEFAULT_SBR", "Body", "Looks", "PartSurfaces", "SbrSettings", "Surface", "scattering_matrices"]
