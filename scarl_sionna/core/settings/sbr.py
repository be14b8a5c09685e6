"""The knobs of physical optics, for a body in the far field and for a scene: what error each one bounds.

docs/rcs.md has the tables of error against time for the far field (:func:`scarl_sionna.rcs`, scattering centres,
calibration), docs/sbr.md those for a scene (``solve_paths(method="sbr")``).
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Decibels, Degrees, Unit

Array = npt.NDArray[np.float64]
Wavelengths = Annotated[float, Unit("wavelengths")]

SMALLEST_SIZE = 3.0
"""Largest extent [wavelengths] below which physical optics is more than some 0.2 dB off even for a plate head-on."""

FINE_SIZE = 140.0
"""Bodies up to 1.4 times this many wavelengths have the finest default; then rays stand twice as far apart with each
doubling."""
FINEST = 1.0
"""Distance of rays [wavelengths] below which no default goes."""
COARSEST = 4
"""Doublings at most: rays 16 wavelengths apart."""
FINE_BISECTIONS, COARSE_BISECTIONS, SCENE_BISECTIONS = 11, 5, 9
"""Default of `bisections`: of a body, of a large body whose spacing follows its size, and in a scene."""


class SbrSettings(Spec):
    """Knobs of shooting and bouncing rays with physical optics, for a body in the far field and for a scene.

    What is None follows the geometry: in the far field the size of the body, in a scene the distance. Where a
    description begins with "scene:", the far field does not read the field, since a plane wave's phase is linear over
    every footprint and its integral exact.
    """

    max_depth: int = Field(
        3,
        ge=1,
        le=32,
        description="largest number of bounces; 3 covers every corner reflector (docs/rcs.md, docs/sbr.md)",
    )
    ray_spacing: Wavelengths | None = Field(
        None,
        gt=0.0,
        le=64.0,
        description="largest distance between the rays that probe a tube [wavelengths]: what is smaller can be "
        "missed as an obstacle or as the next thing hit. None: 1 to 16 by the size of a body (docs/rcs.md), "
        "ray_share in a scene",
    )
    edge_spacing: Wavelengths | None = Field(
        None,
        gt=0.0,
        le=16.0,
        description="tubes that straddle an edge are halved down to this size [wavelengths] and then cut along it. "
        "None: 0.25 to 8 by the size of a body (docs/rcs.md), edge_share in a scene",
    )
    bisections: int | None = Field(
        None,
        ge=1,
        le=24,
        description="the place of an edge is found to 2^-bisections of the tube that it cuts. None: 11 for a body, 5 "
        "where its ray_spacing follows a large size, 9 in a scene (docs/rcs.md)",
    )
    corner_share: float = Field(
        0.125,
        gt=0.0,
        le=1.0,
        description="part of the edge spacing down to which tubes are halved in which more than two things meet; "
        "smaller ones are probed by one ray (docs/rcs.md)",
    )
    max_rays: int = Field(
        1_000_000, ge=1000, description="rays worked at once: bounds the memory, changes no result (docs/rcs.md)"
    )
    max_tubes: int = Field(
        125_000, ge=100, description="tubes worked at once: bounds the memory, changes no result (docs/rcs.md)"
    )
    max_phase: Annotated[float, Unit("rad")] = Field(
        0.2,
        gt=0.0,
        le=3.0,
        description="scene: largest departure of the phase over a patch from a linear one, at half of its longest "
        "side [rad]: size of what is one path (docs/sbr.md)",
    )
    integration_phase: Annotated[float, Unit("rad")] = Field(
        0.01,
        gt=0.0,
        le=3.0,
        description="scene: the same for the parts over which the field of a patch is integrated with a linear phase "
        "[rad] (docs/sbr.md)",
    )
    max_ramp: Annotated[float, Unit("rad")] = Field(
        0.5,
        gt=0.0,
        le=3.0,
        description="scene: largest change of the phase between the middle and the end of a patch's side that "
        "another antenna, or the end of the band, makes [rad] (docs/sbr.md)",
    )
    max_turn: Annotated[float, Unit("rad")] | None = Field(
        0.25,
        gt=0.0,
        le=3.0,
        description="scene: the same that motion across the view makes over a frame, over which the pattern of a patch "
        "is followed to second order: -64 dB at 0.25, -57 dB at 1, -42 dB at 2 [rad]. None: patches do not follow "
        "from motion (docs/sbr.md)",
    )
    ray_share: float = Field(
        0.5,
        gt=0.0,
        le=4.0,
        description="scene: distance of the rays where ray_spacing is None, as a share of the side that max_phase "
        "allows (docs/sbr.md)",
    )
    edge_share: float = Field(
        0.125,
        gt=0.0,
        le=4.0,
        description="scene: size of the tubes cut along edges where edge_spacing is None, as a share of the side "
        "that max_phase allows (docs/sbr.md)",
    )
    pane_loss_db: Decibels | None = Field(
        20.0,
        ge=0.0,
        le=200.0,
        description="scene: layers that take no more than this there and back, at normal incidence, let waves through "
        "to what is behind and back [dB]; None: nothing does (docs/sbr.md)",
    )
    own_panes: bool = Field(
        False,
        description="scene: whether a body is seen through panes of its own too: the inside of a car takes "
        "three to ten times the time of its outside (docs/sbr.md)",
    )
    sheet_share: float = Field(
        0.15,
        gt=0.0,
        le=64.0,
        description="scene: the same two are at most this share, and edge_share / ray_share of it, of the size of the "
        "sheet from which a tube comes (faces that go on without an edge), but not below 1 and 0.25 wavelengths: so a "
        "small corner is cut as finely far away as near by (docs/sbr.md)",
    )
    narrow_share: float = Field(
        1.0 / 12.0,
        gt=0.0,
        le=1.0,
        description="scene: rays beside narrow bodies, such as posts, stand as close as these are wide, but not closer "
        "than this share of their distance elsewhere; 1: bodies between the rays are not looked for (docs/sbr.md)",
    )
    narrow_shadows: bool = Field(
        True,
        description="scene: whether narrow bodies between the rays are looked for as what hides, too, not only as what "
        "reflected rays meet next (docs/sbr.md)",
    )
    crease_angle_deg: Degrees = Field(
        35.0,
        ge=0.0,
        le=60.0,
        description="faces that bend by less than this from one to the next, over four in a row, stand for a curved "
        "surface, over which the phase is integrated [deg]; 0: every face is as flat as it is drawn (docs/rcs.md)",
    )
    surface_phase: Annotated[float, Unit("rad")] = Field(
        0.05,
        gt=0.0,
        le=3.0,
        description="largest departure of the phase over a part of a curved face from a linear one, at half of its "
        "longest side [rad] (docs/rcs.md)",
    )
    edge_diffraction: bool = Field(
        False,
        description="whether edges that bend by more than crease_angle_deg, and borders of sheets, scatter what their "
        "currents have beyond physical optics, where both ends see them without a bounce (docs/rcs.md)",
    )
    reciprocal: bool | None = Field(
        None,
        description="scene: a pair of radars is solved from either end, each with half of the field: exchanged they "
        "see the same, which physical optics alone does not give off its flashes, for twice the time. None: in a "
        "network, which solves both senses of its pairs anyway. One radar with antennas of several polarisations hears "
        "chains of bounces in both senses, HV as VH, unless this is False (docs/sbr.md)",
    )
    grazing_cosine: float = Field(
        0.02,
        ge=0.0,
        le=1.0,
        description="scene: tubes that a face meets at less than this cosine are not cut along edges: their field is "
        "34 dB down, and float32 rays do not tell a face just behind a silhouette from one just before it "
        "(docs/sbr.md)",
    )
    return_angle: Annotated[float, Unit("rad")] | None = Field(
        None,
        gt=0.0,
        le=math.pi,
        description="scene: after the first bounce, tubes are followed only where a ray comes back, and footprints "
        "kept only where their mirror direction is, within this angle of the receiver's [rad]: what is left out are "
        "side lobes. None: all (docs/sbr.md)",
    )
    coefficient_nodes: int = Field(
        8193,
        ge=3,
        le=1_000_001,
        description="scene: nodes of the table of reflection coefficients over the square root of the cosine of "
        "incidence: linear interpolation is right to 2e-6 for layers of some millimetres (docs/sbr.md)",
    )
    num_tubes: int | None = Field(
        None,
        ge=1,
        description="scene: cut the faces in view into about this many first tubes of equal sides, where max_phase "
        "does not ask for smaller ones; None: as few as it allows (docs/sbr.md)",
    )
    max_patches: int = Field(
        20_000_000, ge=1, description="scene: more patches than this are refused: bounds the memory, changes no result"
    )
    diffuse: bool = Field(
        True, description="scene: whether rough surfaces scatter the part S of their reflection diffusely"
    )
    seed: int = Field(
        0, ge=0, le=2**63 - 1, description="scene: of the random phases of the diffusely scattering patches"
    )
    floor_db: Decibels | None = Field(
        -10.0,
        description="scene: patches of a range bin are left out as long as the power of all of them in phase stays "
        "this far from the noise of one cell of the range-Doppler-angle cube [dB]; None keeps all (docs/sbr.md)",
    )

    @model_validator(mode="after")
    def _check(self) -> SbrSettings:
        if self.ray_spacing is not None and self.edge_spacing is not None and self.edge_spacing > self.ray_spacing:
            raise ValueError("edge_spacing <= ray_spacing")
        return self

    def for_size(self, size: float) -> SbrSettings:
        """Return the settings for a body in the far field: what is None follows its largest extent, `size` wavelengths.

        What a cut along one edge can be wrong by is an area of some `edge_spacing` squared, while a body's echo grows
        with its own size: so rays of a large body stand farther apart. docs/rcs.md has the measured error of a car
        (1,100 wavelengths).

        Parameters
        ----------
        size : float
            Largest extent of the body, a number of wavelengths (dimensionless).
        """
        doublings = int(min(max(round(math.log2(max(size, 1.0) / FINE_SIZE)), 0), COARSEST))
        follows = self.ray_spacing is None and self.edge_spacing is None
        ray, edge = self.ray_spacing, self.edge_spacing
        if ray is None:
            ray = max(2.0**doublings, edge or 0.0)
        if edge is None:
            edge = min(2.0 ** (doublings - 1) if doublings else 0.25, ray)
        bisections = COARSE_BISECTIONS if follows and doublings else FINE_BISECTIONS
        return self.with_(
            ray_spacing=ray, edge_spacing=edge, bisections=bisections if self.bisections is None else self.bisections
        )

    def for_scene(self) -> SbrSettings:
        """Return the settings for a scene: `bisections` filled in.

        Spacings that are None follow the distance, see :meth:`spacings`.
        """
        return self if self.bisections is not None else self.with_(bisections=SCENE_BISECTIONS)

    def spacings(
        self, wavelength: float | Array, side: Array | None = None, sheet: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the largest distance of rays, and the size down to which tubes are halved at edges [m].

        Parameters
        ----------
        wavelength : float or ndarray of float64, of any shape
            [m].
        side : ndarray of float64, optional
            In a scene: the side of a patch that `max_phase` allows [m]. Left out, the settings are those of
            :meth:`for_size`.
        sheet : ndarray of float64, optional
            In a scene: the size of the sheet from which a tube comes [m].

        Returns
        -------
        ray, edge : ndarray of float64, scalar or of the shape of the arguments
            [m].

        Raises
        ------
        ParameterRangeError
            If a spacing is None and no side is given.
        """
        found = []
        if side is not None and sheet is not None:
            allowed = self.sheet_share / self.ray_share * sheet
            side = np.minimum(side, np.maximum(allowed, FINEST / self.ray_share * wavelength))
        for spacing, share in ((self.ray_spacing, self.ray_share), (self.edge_spacing, self.edge_share)):
            if spacing is None and side is None:
                raise ParameterRangeError(
                    "ray_spacing, edge_spacing",
                    "None without a side",
                    "numbers [wavelengths]",
                    "settings of a body come from for_size()",
                )
            found.append(np.asarray(share * side if spacing is None else spacing * wavelength))  # type: ignore[operator]
        return found[0], found[1]


DEFAULT_SBR = SbrSettings()
