"""What tracings ask of footprints: where they are to be cut, so that each piece has one label."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine.rays.face_planes import FaceTable
from scarl_sionna.engine.rays.face_rays import MISS, FaceRays

from ..faces.panes import Panes
from ..patches import EvenSize, split
from .probes import CentralRays, PlaneProbe, Probe, Receivers
from .refine import Pieces, refined
from .screens import Screen, ScreenedProbe, Window
from .spacings import Spacings
from .together import Question
from .trace import TableT

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cut(Question):
    """Footprints to cut; the answer is the pieces, with the rows of the footprints of which they are.

    Attributes
    ----------
    place : tuple of int
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        [m].
    spacings : Spacings
        How finely they are probed and halved.
    target : Seen or Landing
        By what they are labelled.
    settings : SbrSettings
    """

    place: tuple[int, ...]
    corners: Array
    spacings: Spacings
    target: Seen | Landing
    settings: SbrSettings

    def __len__(self) -> int:
        return len(self.corners)

    @property
    def key(self) -> Hashable:
        """What is asked together: by one probe, beside the same bodies and with the same knobs."""
        knobs, near = self.settings, self.spacings.near
        bodies = None if near is None else (id(near.bodies), near.is_way_in)
        return Cut, type(self.target), self.target.key, bodies, knobs.bisections, knobs.corner_share, knobs.max_rays

    @classmethod
    def answered(cls, questions: Sequence[Cut]) -> list[Pieces]:
        """Return the pieces of each question."""
        corners = np.concatenate([one.corners for one in questions])
        spacings = Spacings.joined([one.spacings for one in questions])
        targets = [one.target for one in questions]
        probe: Probe = type(targets[0]).probe(targets)  # type: ignore[arg-type,misc] # all of one type, by the key
        corners, rows, label = refined(corners, np.arange(len(corners)), probe, spacings, questions[0].settings)
        if len(questions) == 1:
            return [(corners, rows, label)]
        ends = np.cumsum([len(one) for one in questions])
        asked = np.searchsorted(ends, rows, side="right")
        order = np.argsort(asked, kind="stable")
        parts = np.split(order, np.searchsorted(asked[order], np.arange(1, len(questions))))
        starts = ends - [len(one) for one in questions]
        return [(corners[part], rows[part] - start, label[part]) for part, start in zip(parts, starts, strict=True)]


@dataclass(frozen=True, eq=False)
class Seen:
    """Whether a station sees points of faces, `face` (num_tubes,), and through which panes."""

    rays: FaceRays
    screen: Screen
    face: Index
    panes: Panes | None

    @property
    def key(self) -> Hashable:
        """Rays, panes, mirrors, and what a station looks through."""
        window = self.screen.window
        owner = None if window is None else window.owner
        return id(self.rays), id(self.panes), id(owner), self.screen.shape

    @staticmethod
    def probe(targets: Sequence[Seen]) -> Probe:
        """Return the probe of several stations."""
        screen = np.repeat(np.arange(len(targets)), [len(one.face) for one in targets])
        face = np.concatenate([one.face for one in targets])
        return ScreenedProbe(targets[0].rays, [one.screen for one in targets], screen, face, targets[0].panes)


@dataclass(frozen=True, eq=False)
class Landing:
    """Which plane reflected tubes meet.

    Attributes
    ----------
    rays : FaceRays
    faces : FaceTable
    chosen : ndarray of bool, shape (num_faces,)
        Faces that reflect; at the others tubes end.
    source, lift : ndarray of float64, shape (num_tubes, 3)
        Where the rays seem to come from [m], and the unit normal on the side on which they run.
    own : ndarray of int64, shape (num_tubes,)
        Face that each tube leaves.
    stations : ndarray of float64, shape (num_receivers, 3), optional
        On the last bounce: to one of which planes must be turned [m].
    angle : float, optional
        By how much the mirror direction may then be off that of the receiver [rad].
    """

    rays: FaceRays
    faces: FaceTable
    chosen: npt.NDArray[np.bool_]
    source: Array
    lift: Array
    own: Index
    stations: Array | None = None
    angle: float | None = None

    @property
    def key(self) -> Hashable:
        """Rays, faces, and whether it is the last bounce."""
        return id(self.rays), id(self.faces), id(self.chosen), self.stations is not None, self.angle

    @staticmethod
    def probe(targets: Sequence[Landing]) -> Probe:
        """Return the probe of several bounces."""
        rays, faces, angle = targets[0].rays, targets[0].faces, targets[0].angle
        source, lift, own = (
            np.concatenate([getattr(one, name) for one in targets]) for name in ("source", "lift", "own")
        )
        plane_of_face = np.where(targets[0].chosen, faces.plane, MISS)
        probe = PlaneProbe(rays, CentralRays(rays, source), lift, plane_of_face, faces.plane[own])
        stations = [one.stations for one in targets if one.stations is not None]
        if stations:
            target = np.repeat(np.arange(len(targets)), [len(one.own) for one in targets])
            receivers = Receivers(rays, stations, target)
            probe.only_towards(receivers, faces.triangles.normal, faces.triangles.offset, angle)
        return probe


def cut_at_ends(tubes: TableT, windows: Sequence[Window | None], settings: SbrSettings) -> TableT:
    """Return footprints, cut so that the ends of the mirrors of some windows change the field little over each."""
    across = [one.across_ends for one in dict.fromkeys(windows) if one is not None and one.across_ends is not None]
    if not across or not len(tubes):
        return tubes
    anywhere = np.zeros((1, 3))  # only mirrors count
    corners, rows = split(
        tubes.corners, anywhere, anywhere[0], EvenSize(across, settings.edge_share), settings.max_patches
    )
    return tubes.take(rows, corners)
