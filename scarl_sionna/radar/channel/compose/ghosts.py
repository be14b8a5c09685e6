"""Objects seen through mirrors: ground bounce and ghosts of whole meshes, solved from the radar's images.

An object is seen from the image of the transmitter and that of the receiver, each through the plane of its last mirror,
so its scattering is that of the aspects under which the mirrored waves meet it. What the mirrors do to polarisation,
length and rate, and what hides the way before the last mirror, is added path by path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations_with_replacement, permutations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.paths.tracing import SPECULAR
from scarl_sionna.radar.channel.multipath.images import spherical_basis
from scarl_sionna.radar.channel.multipath.mirror_faces import COINCIDENT, NO_MIRROR, inside
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.tracing import Pair
from scarl_sionna.radar.channel.scatterers import PlacedModel
from scarl_sionna.radar.optics.tubes.screens import Strips, Window
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths, bend_of
from scarl_sionna.radar.point_scatterers import POINT_INTERACTION
from scarl_sionna.signal.link import spreading

from .budget import BOX_POINTS, box_points
from .expected_error import owners
from .mirror_legs import Leg, MirrorView
from .mirrors import Mirror, Way, mirrored, reaches, ways
from .plan import Seen

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


_CROSSINGS = 16
"""Faces above the underside of a body that are counted at most."""


class Image(NamedTuple):
    """An image of the radar."""

    pose: Pose
    way: Way
    """The mirrors that made it; none for the radar itself."""


Images = tuple[Image, Image]
"""Two images of the radar, both with the same axes: that to which a way there leads, and that of a way back."""
Faces = tuple[tuple[int, ...], tuple[int, ...]]
"""Numbers of the mirrors of a way there and of a way back, each in the order from the radar."""
STRAIGHT: Faces = ((), ())
"""Of paths whose mirrors, if they have any, are not told apart by their faces."""


def image_pairs(view: MirrorView, over: Sequence[Mirror], depth: int, reach: float) -> list[Images]:
    """Return the images between which objects are seen over at least one mirror, the same object where they are equal.

    Of a way there and another one back one order only.

    Parameters
    ----------
    view : MirrorView
    over : sequence of Mirror
        Those of the view's mirrors that the ways may take.
    depth : int
        Most mirrors of one way.
    reach : float
        Half of the longest length [m].
    """
    pose, found = view.mount.pose, []
    corners = np.concatenate([box_points(view.state, number) for number in view.owned])
    open_ways = [way for way in ways(over, depth) if reaches(way, pose.position, corners, view.tail).any()]
    for there, back in combinations_with_replacement(open_ways, 2):
        if not there and not back:
            continue
        images = [mirrored(way, pose.position) for way in (there, back)]
        if min(np.linalg.norm(corners - image, axis=1).min() for image in images) > reach:
            continue
        axes = _looking((images[0] + images[1]) / 2.0, corners.mean(axis=0))
        tx = Image(Pose.from_rotation(images[0], axes), there)
        found.append((tx, tx if there is back else Image(Pose.from_rotation(images[1], axes), back)))
    return found


def paths_through_mirrors(
    view: MirrorView, pairs: Sequence[Images], found: Sequence[RadarPaths], cut: bool = False
) -> list[tuple[RadarPaths, Faces]]:
    """Return the paths of objects over at least one mirror, one block for each pair of a way there and a way back.

    With each block the faces of its ways: mirrors of one instance give the same chain of instances over different
    faces.

    Parameters
    ----------
    view : MirrorView
    pairs : sequence of Images
        Of :func:`image_pairs`.
    found : sequence of RadarPaths
        The paths of the objects between each two images, nothing moving but them.
    cut : bool
        Whether what the images do not show is left out of them. If not, each path is there or not by its points.
    """
    doubled = _doubled(view.mirrors) if cut else set()  # rays cannot tell which of them they meet
    blocks = []
    for (tx, rx), paths in zip(pairs, found, strict=True):
        there, back = tx.way, rx.way
        block = _seen(view, paths, (tx, rx), cut and doubled.isdisjoint(mirror.number for mirror in there + back))
        met = tuple(mirror.number for mirror in there), tuple(mirror.number for mirror in back)
        blocks.append((block, met))
        if there is not back:
            blocks.append((block.reversed(), met[::-1]))
    return blocks


def weighted(paths: RadarPaths, met: Faces, seen: Seen, instance: Mapping[int, int]) -> RadarPaths:
    """Return paths over mirrors with the weights of their legs.

    Parameters
    ----------
    paths : RadarPaths
    met : Faces
        Mirrors of the ways there and back.
    seen : Seen
        With the weight of each object and mirror.
    instance : mapping
        Instances of the mirrors, by their numbers.
    """
    weight = np.ones(paths.num_paths)
    for way, last in zip(met, (False, True), strict=True):
        own = owners(paths, seen.objects, last=last)
        for number in np.unique(own).tolist():
            over = [seen.weights.get((number, instance[mirror]), 1.0) for mirror in way]
            weight[own == number] *= np.prod(over)
    return paths.scaled(weight)


def _looking(start: Array, end: Array) -> Array:
    """Return axes whose x points from start to end and whose y is level."""
    x = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    helper = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    y = np.cross(helper, x)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _seen(view: MirrorView, found: RadarPaths, images: Images, cut: bool) -> RadarPaths:
    """Return the paths as the radar itself sees them, without those that the surroundings hide unless that is done."""
    state, pose, both = view.state, view.mount.pose, (images[0].way, images[1].way)
    if not cut:
        found = found.select(_shown(view, found, images))
    there, back = _legs(view, found, images)
    changed: dict[str, Any] = {name: value for name, value in vars(found).items()}
    weight = there.weight * back.weight
    visible = weight != 0.0
    changed["a"] = np.einsum("pki,pkl,plj->pij", back.jones, found.a, there.jones) * weight[:, None, None]
    ends = zip(("tx_slope", "rx_slope"), images, strict=True)
    for name, turn in ((name, _from_image(image, pose)) for name, image in ends):
        if (slope := getattr(found, name)) is not None:
            turned = np.einsum("pki,pmkl,plj,mn->pnij", back.jones, slope, there.jones, turn, optimize=True)
            changed[name] = turned * weight[:, None, None, None]
    changed |= {
        "tx_point": there.image,
        "rx_point": back.image,
        "length_rate": found.length_rate
        - sum(np.einsum("pi,pi->p", way.direction, way.station_velocity) for way in (there, back)),
        "length_acceleration": sum(bend_of(way.image - pose.position, way.image_velocity) for way in (there, back)),
        "instance": _chained(state, both, found.instance, None),
        "interaction": _chained(state, both, found.interaction, SPECULAR),
        "depth": (found.depth + len(both[0]) + len(both[1])).astype(np.int32),
        "world_from_tx": pose,
        "world_from_rx": pose,
        "rx_image": None,
        "over_time": None,  # of an image that stands
        "tx_velocity": there.image_velocity,
        "rx_velocity": back.image_velocity,
        "tx_twist": view.mount.twist,
        "rx_twist": view.mount.twist,
    }
    result = RadarPaths(**changed)
    return result if visible.all() else result.select(visible)


def _from_image(image: Image, pose: Pose) -> Array:
    """Return the axes of a radar as its image has them, in columns, shape (3, 3): what changes along one changes so."""
    axes = np.stack([mirrored(image.way, axis) for axis in pose.rotation.T], axis=1)
    at_origin = mirrored(image.way, np.zeros(3))
    return np.asarray(image.pose.rotation.T @ (axes - at_origin[:, None]))


def _shown(view: MirrorView, found: RadarPaths, images: Images) -> Flags:
    """Return of which paths both ends are seen over the images' mirrors, with nothing in between."""
    station = Viewpoint.of(view.radar, view.mount.pose, np.zeros(3))

    def sees(image: Image, points: Array) -> Flags:
        ways = _ways(image, len(points))
        return view.shows(ways, points) & station.sees(view.chain(ways).images(points)[:, 0])

    shown = sees(images[0], found.tx_point)
    rest = np.flatnonzero(shown)
    if images[0] is images[1]:
        rest = rest[(found.tx_point[rest] != found.rx_point[rest]).any(axis=1)]
    shown[rest] = sees(images[1], found.rx_point[rest])
    return shown


def _ways(image: Image, count: int) -> npt.NDArray[np.int64]:
    return np.tile([mirror.number for mirror in image.way], (count, 1)).astype(np.int64)


def _legs(view: MirrorView, found: RadarPaths, images: Images) -> tuple[Leg, Leg]:
    """Return the ways to the first points of paths, and those back from the last ones.

    Seen from one image most paths begin and end at the same point: its way is computed once.
    """
    ends = found.tx_point, found.rx_point
    moving = found.filled("tx_velocity"), found.filled("rx_velocity")  # the images of the radar were at rest

    def leg(image: Image, points: Array, velocities: Array) -> Leg:
        return view.leg(_ways(image, len(points)), image.pose.rotation, points, velocities)

    if images[0] is not images[1]:
        return leg(images[0], ends[0], moving[0]), leg(images[1], ends[1], moving[1])
    apart = np.flatnonzero((ends[0] != ends[1]).any(axis=1) | (moving[0] != moving[1]).any(axis=1))
    points, velocities = (np.concatenate([one, other[apart]]) for one, other in (ends, moving))
    whole = leg(images[0], points, velocities)
    start = np.arange(found.num_paths)
    end = start.copy()
    end[apart] = len(start) + np.arange(len(apart))
    return whole.take(start), whole.take(end)


def _chained(
    state: WorldState, both: tuple[Way, Way], own: npt.NDArray[np.int32], kind: int | None
) -> npt.NDArray[np.int32]:
    """Return labels along the way: mirrors there, the object's own, mirrors back; -1 behind the last."""
    count = len(own)
    ends = [
        np.array(
            [[state.world.parts.instance[mirror.part] if kind is None else kind for mirror in way]] * count
        ).reshape(count, len(way))
        for way in both
    ]
    columns = np.concatenate([ends[0], own, ends[1][:, ::-1]], axis=1)
    return np.take_along_axis(columns, np.argsort(columns == -1, axis=1, kind="stable"), axis=1).astype(np.int32)


def of_models(state: WorldState, radar: RadarSpec, models: Sequence[PlacedModel], images: Images) -> RadarPaths:
    """Return the paths of scattering centres between two images of the radar.

    Notes
    -----
    A model is monostatic: between two directions it is taken at their bisector, which is right for small angles between
    them.

    References
    ----------
    .. [1] R. E. Kell, "On the derivation of bistatic RCS from monostatic measurements", Proc. IEEE 53(8), 1965.
    """
    tx, rx = images
    blocks = [_of_model(state, radar, tx.pose, rx.pose, one) for one in sorted(models, key=lambda one: one.number)]
    joined: dict[str, Any] = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    count = len(joined["semantic"])
    return RadarPaths(
        **joined,
        inner_length=np.zeros(count),
        length_acceleration=np.zeros(count),
        interaction=np.full((count, 1), POINT_INTERACTION, np.int32),
        depth=np.ones(count, np.int32),
        world_from_tx=tx.pose,
        world_from_rx=rx.pose,
    )


def _of_model(
    state: WorldState, radar: RadarSpec, tx: Pose, rx: Pose, placed: PlacedModel
) -> dict[str, npt.NDArray[Any]]:
    info = state.world.instances[placed.number]
    world_from_model = placed.world_from_model(state)
    point = world_from_model.apply(placed.model.centers)
    velocity = state.point_velocity(np.full(len(point), info.parts[0], dtype=np.int64), point)
    turn, directions, distances, rate = [], [], [], np.zeros(len(point))
    for image in (tx, rx):
        offset = point - image.position
        distance = np.linalg.norm(offset, axis=1)
        direction = offset / distance[:, None]
        basis = spherical_basis(world_from_model.rotation, -direction)
        turn.append(np.einsum("nri,nbi->nrb", spherical_basis(image.rotation, direction), basis))
        rate += np.einsum("ni,ni->n", direction, velocity)
        directions.append(direction)
        distances.append(distance)
    middle = directions[0] + directions[1]
    middle = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    mean = 2.0 / (1.0 / distances[0] + 1.0 / distances[1])
    matrix = placed.model.matrices(-middle @ world_from_model.rotation, mean)
    scale = spreading(radar.wavelength, *distances)
    return {
        "tx_point": point,
        "rx_point": point,
        "a": np.einsum("nrb,nbc,ntc->nrt", turn[1], matrix, turn[0]) * scale[:, None, None],
        "length_rate": rate,
        "tx_velocity": velocity,
        "rx_velocity": velocity,
        "instance": np.full((len(point), 1), placed.number, dtype=np.int32),
        "semantic": np.full(len(point), info.semantic, dtype=np.uint8),
    }


class Meshes:
    """The meshes of one share of a solve, seen from images of the radar by `sbr`.

    Parameters
    ----------
    bodies : Bodies
        What scatters.
    """

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies
        self._mirror_of_face: npt.NDArray[np.int64] | None = None

    def pairs(self, view: MirrorView, images: Sequence[Images]) -> list[Pair]:
        """Return the stations of images, which light the view's objects.

        Parameters
        ----------
        view : MirrorView
            Its mirrors are the same at every call.
        images : sequence of Images
        """
        corners = np.concatenate([box_points(view.state, number) for number in view.owned])
        alone = {image.way[0].number for pair in images for image in pair if len(image.way) == 1}
        beside = {number: view.strips(number, corners, BOX_POINTS) for number in sorted(alone)}
        windows: dict[tuple[int, ...], Window | None] = {}  # one for each way, so that its tubes are traced once

        def viewpoint(image: Image) -> Viewpoint:
            way = tuple(mirror.number for mirror in image.way)
            if way not in windows:
                windows[way] = self._window(view, image, beside)
            return self._viewpoint(view, image, windows[way])

        found = []
        for tx, rx in images:
            first = viewpoint(tx)
            found.append(Pair(first, first if tx is rx else viewpoint(rx), view.owned))
        return found

    def _owner(self, view: MirrorView) -> npt.NDArray[np.int64]:
        if self._mirror_of_face is None:
            self._mirror_of_face = _owners(view.state, view.mirrors, view.knobs.thickness)
        return self._mirror_of_face

    def _window(self, view: MirrorView, image: Image, strips: Mapping[int, Strips | None]) -> Window | None:
        """Return the mirrors through which an image looks: what lies on them hides nothing.

        `strips` are those beside the mirrors that are met alone, by their numbers.
        """
        window, source, lift = None, view.mount.pose.position, view.knobs.thickness
        beside = strips[image.way[0].number] if len(image.way) == 1 else None
        for mirror in image.way:  # static ones
            side = np.sign(float(mirror.height(source)))
            plane = side * mirror.normal, side * mirror.offset
            across = None if beside is None or not len(beside.length) else partial(view.across_ends, mirror.number)
            window = Window(*plane, self._owner(view), mirror.number, lift, source, window, beside, across)
            source = mirrored((mirror,), source)
        return window

    def _viewpoint(self, view: MirrorView, image: Image, window: Window | None) -> Viewpoint:
        """Return an image of the radar, which looks through its mirrors."""
        axes, passing = view.mount.pose.rotation, view.mount.twist.linear
        for mirror in image.way:
            axes = axes - 2.0 * np.outer(mirror.normal, mirror.normal @ axes)
            passing = passing - 2.0 * (mirror.normal @ passing) * mirror.normal
        station = Viewpoint.of(view.radar, image.pose, np.zeros(3))
        return replace(station, window=window, axes=axes, passing=passing)


def _doubled(mirrors: Sequence[Mirror]) -> set[int]:
    """Return the numbers of mirrors that lie on another one in the same plane, at some of a few points of each face."""
    found: set[int] = set()
    shares = np.random.default_rng(0).dirichlet(np.ones(3), 16)
    for one, other in permutations(mirrors, 2):
        if {one.number, other.number} <= found or np.abs(one.height(other.corners)).max() > COINCIDENT:
            continue
        points = (shares @ other.corners.reshape(-1, 3, 3)).reshape(-1, 3)
        if inside(points, one.corners.reshape(-1, 3, 3), one.normal).any():
            found |= {one.number, other.number}
    return found


def _owners(state: WorldState, mirrors: Sequence[Mirror], thickness: float) -> npt.NDArray[np.int64]:
    """Return the mirror that each face of a state is part of, or lies on, as a marking does; `NO_MIRROR` if none.

    What lies on several belongs to the nearest, so that nothing is seen over two. The underside of a closed part lies
    on none: nothing comes out of the body through it.
    """
    triangles = state._triangles
    up = np.zeros((len(triangles.corners), 3))
    owner = np.full(len(triangles.corners), NO_MIRROR, dtype=np.int64)
    least = np.full(len(owner), thickness)
    first = np.ascontiguousarray(triangles.corners[:, 0])
    for mirror in mirrors:
        near = np.flatnonzero(np.abs(mirror.height(first)) < least)  # few are: the other corners of those only
        height = np.abs(mirror.height(triangles.corners[near])).max(axis=1)
        near, height = near[height < least[near]], height[height < least[near]]
        over = inside(triangles.corners[near].mean(axis=1), mirror.corners.reshape(-1, 3, 3), mirror.normal)
        owner[near[over]], least[near[over]] = mirror.number, height[over]
        center = triangles.corners[near[over]].mean(axis=1)
        up[near[over]] = np.sign(mirror.height(center))[:, None] * mirror.normal
    for mirror in mirrors:
        up[mirror.faces] = 0.0
    on = np.flatnonzero(owner != NO_MIRROR)
    owner[on[_undersides(state, on, up[on])]] = NO_MIRROR
    for mirror in mirrors:
        owner[mirror.faces] = mirror.number
    return owner


def _undersides(state: WorldState, face: npt.NDArray[np.int64], up: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which faces have the inside of their own part on the side of a direction.

    An odd number of its faces is met there before anything else. Of directions of no length none has.
    """
    triangles, found = state._triangles, np.zeros(len(face), dtype=np.bool_)
    start, rows = triangles.corners[face].mean(axis=1), np.flatnonzero(up.any(axis=1))
    for _ in range(_CROSSINGS):
        if not len(rows):
            return found
        hits = state.cast(start[rows] + COINCIDENT * up[rows], up[rows])
        own = hits.part == triangles.part[face[rows[hits.ray]]]
        rows = rows[hits.ray[own]]
        found[rows] ^= True
        start[rows] = hits.point[own]
    return found
