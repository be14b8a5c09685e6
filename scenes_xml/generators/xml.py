"""Writer of plain Mitsuba 3 scene XML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr


@dataclass(frozen=True)
class Bsdf:
    """One optical material, and what the other sensors need to know of it.

    Attributes
    ----------
    plugin : str
        Mitsuba plugin, for example ``principled`` or ``diffuse``.
    radio : str
        Name of the radio material.
    lidar_reflectance : float
        Diffuse reflectance at 1550 nm, 0 to 1.
    source : str
        Where the reflectance comes from.
    color : tuple of float, optional
        Linear RGB base colour or reflectance; or
    texture : str, optional
        a PNG in ``textures/``, instead of the colour.
    floats : mapping
        Further float parameters of the plugin.
    retroreflection : float
        Of a sheet or a prism, R_A [cd/(lx m2)].
    retroreflected_luminance : float
        Of beads in a marking, R_L [cd/(lx m2)].
    lamp : str, optional
        Kind of lamp that the surface is: ``headlamp``, ``taillamp``, ``indicator``, ``street_lamp``.
    wets : float
        How much of the ground's wetness it takes, 0 to 1.
    puddles : str, optional
        A PNG in ``textures/`` of where water stands, bright = deep.
    """

    plugin: str
    radio: str
    lidar_reflectance: float
    source: str
    color: tuple[float, float, float] | None = None
    texture: str | None = None
    floats: Mapping[str, float] = field(default_factory=dict)
    retroreflection: float = 0.0
    retroreflected_luminance: float = 0.0
    lamp: str | None = None
    wets: float = 0.0
    puddles: str | None = None

    def table(self) -> dict[str, str | float]:
        """Return what scene.toml says of the material."""
        table: dict[str, str | float] = {
            "radio": self.radio,
            "lidar_reflectance": self.lidar_reflectance,
            "source": self.source,
        }
        if self.retroreflection:
            table["retroreflection"] = self.retroreflection
        if self.retroreflected_luminance:
            table["retroreflected_luminance"] = self.retroreflected_luminance
        if self.lamp:
            table["lamp"] = self.lamp
        if self.wets:
            table["wets"] = self.wets
        if self.puddles:
            table["puddles"] = f"textures/{self.puddles}"
        return table


@dataclass(frozen=True)
class Placement:
    """One shape: its mesh file, its material and its pose (turn about z [deg], then shift [m])."""

    shape: str
    mesh: str
    bsdf: str
    yaw_deg: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0


def bsdf_xml(name: str, bsdf: Bsdf) -> str:
    """Return a ``<bsdf>`` element that is the same from both sides."""
    slot = {"diffuse": "reflectance", "thindielectric": "specular_transmittance"}.get(bsdf.plugin, "base_color")
    is_thin = bsdf.plugin in ("principledthin", "thindielectric")  # light passes through: has both sides by itself
    if is_thin:
        lines = [f'\t<bsdf type="{bsdf.plugin}" id={quoteattr(name)}>']
    else:
        lines = [f'\t<bsdf type="twosided" id={quoteattr(name)}>', f'\t\t<bsdf type="{bsdf.plugin}">']
    if bsdf.texture is not None:
        lines.append(f'\t\t\t<texture type="bitmap" name="{slot}">')
        lines.append(f'\t\t\t\t<string name="filename" value="textures/{bsdf.texture}"/>')
        lines.append("\t\t\t</texture>")
    elif bsdf.color is not None:
        lines.append(f'\t\t\t<rgb name="{slot}" value="{" ".join(f"{c:g}" for c in bsdf.color)}"/>')
    lines += [f'\t\t\t<float name="{key}" value="{value:g}"/>' for key, value in bsdf.floats.items()]
    return "\n".join([*lines, *([] if is_thin else ["\t\t</bsdf>"]), "\t</bsdf>"])


def shape_xml(p: Placement) -> str:
    """Return a ``<shape>`` element of type ply."""
    lines = [f'\t<shape type="ply" id={quoteattr(p.shape)}>', f'\t\t<string name="filename" value="meshes/{p.mesh}"/>']
    if p.yaw_deg or any(p.offset) or p.scale != 1.0:
        lines.append('\t\t<transform name="to_world">')
        if p.scale != 1.0:
            lines.append(f'\t\t\t<scale value="{p.scale:g}"/>')
        if p.yaw_deg:
            lines.append(f'\t\t\t<rotate z="1" angle="{p.yaw_deg:.9g}"/>')
        x, y, z = p.offset
        lines.append(f'\t\t\t<translate x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>')
        lines.append("\t\t</transform>")
    return "\n".join([*lines, f'\t\t<ref id={quoteattr(p.bsdf)} name="bsdf"/>', "\t</shape>"])


def scene_xml(comment: str, head: Sequence[str], bsdfs: Mapping[str, Bsdf], shapes: Sequence[Placement]) -> str:
    """Return a whole scene: `head` holds the integrator, sensor and emitter elements."""
    body = [*head, *(bsdf_xml(name, b) for name, b in bsdfs.items()), *(shape_xml(p) for p in shapes)]
    return "\n".join([f"<!-- {comment} -->", '<scene version="3.0.0">', *body, "</scene>", ""])
