"""Diffusely scattered paths: lengths in float64 on the planes of the triangles, amplitudes by our own law.

Sionna RT samples the paths; what its amplitudes hold of Fresnel's coefficients is replaced.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.seeds import uniform_hash
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.paths.tracing import DIFFUSE, NONE, REFRACTION, SPECULAR, TracedPaths, engine_scattering
from scarl_sionna.engine.twins import ENGINE_THICKNESS, RADIO_FREQUENCY
from scarl_sionna.radar.paths import bend_of
from scarl_sionna.radar.tuned import material_frequency
from scarl_sionna.scene.materials.depolarization import rough_matrix
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.rough import coherent_share, directional_albedo

from .images import Chain, spherical_basis
from .station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]


def diffuse_columns(
    state: WorldState, traced: TracedPaths, tx: Station, rx: Station, radar: RadarSpec
) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of :class:`RadarPaths` for the paths that scatter diffusely at least once, and ``total`` [m].

    A scattering point is the engine's, moved onto the float64 plane of its triangle; what lies before the first and
    behind the last of them is mirrored, so lengths are exact for every antenna. Amplitudes follow the law of
    :func:`.rough.directional_albedo`, water on the surface included.
    """
    rows = np.flatnonzero((traced.kind == DIFFUSE).any(axis=1))
    kind, part, normal = traced.kind[rows], traced.part[rows], traced.normal[rows]
    offset, depth = traced.offset[rows], traced.depth[rows]
    count, width = kind.shape
    height = np.einsum("pdi,pdi->pd", normal, traced.vertex[rows]) - offset
    point = traced.vertex[rows] - height[..., None] * normal
    point = np.where((kind == NONE)[..., None], rx.position, point)
    if width == 0:
        point, first, last = np.zeros((count, 0, 3)), np.zeros(count, np.int64), np.zeros(count, np.int64)
        tx_point = rx_point = tx_velocity = rx_velocity = np.zeros((count, 3))
    else:
        scatters = kind == DIFFUSE
        first, last = scatters.argmax(axis=1), width - 1 - scatters[:, ::-1].argmax(axis=1)
        row, column = np.arange(count), np.arange(width)
        before = _part_of_chain(kind, normal, offset, column < first[:, None])
        behind = _part_of_chain(kind, normal, offset, column > last[:, None])
        reverse = Chain(*(value[:, ::-1] for value in vars(behind).values()))
        tx_point, rx_point = before.images(point[row, first])[:, 0], reverse.images(point[row, last])[:, 0]
        surfaces = state.point_velocity(part.ravel(), point.reshape(-1, 3)).reshape(point.shape)
        tx_velocity = before.image_velocity(surfaces[row, first], surfaces) - tx.velocity
        rx_velocity = reverse.image_velocity(surfaces[row, last], surfaces[:, ::-1]) - rx.velocity
    travel = _directions(tx.position, point, rx.position)
    steps = np.linalg.norm(np.diff(point, axis=1), axis=2) if width > 1 else np.zeros((count, 0))
    column = np.arange(max(width - 1, 0))
    inner = np.sum(steps, axis=1, where=(column >= first[:, None]) & (column < last[:, None]))
    surfaces = state.point_velocity(part.ravel(), point.reshape(-1, 3)).reshape(point.shape)
    arrive = np.take_along_axis(travel, depth[:, None, None].astype(np.int64), axis=1)[:, 0]
    turn = np.where((kind != NONE)[..., None], travel[:, :-1] - travel[:, 1:], 0.0)
    rate = np.einsum("pdi,pdi->p", turn, surfaces) + arrive @ rx.velocity - travel[:, 0] @ tx.velocity
    to_tx = _turned(tx.rotation, travel[:, 0])
    to_rx = _turned(rx.rotation, -arrive)
    cosines = [np.abs(np.einsum("pdi,pdi->pd", way, normal)) for way in (travel[:, :-1], travel[:, 1:])]
    own = _by_albedo(state, traced.a[rows], kind, part, cosines, material_frequency(radar))
    single = np.count_nonzero(kind != NONE, axis=1) == 1
    if single.any():
        own[single] = _rough(state, own[single], part[single, 0], point[single, 0])
    a = np.einsum("pri,pij,ptj->prt", to_rx, own, to_tx) * (radar.wavelength * RADIO_FREQUENCY / SPEED_OF_LIGHT)
    out, home = tx_point - tx.position, rx_point - rx.position
    total = np.linalg.norm(out, axis=1) + inner + np.linalg.norm(home, axis=1)
    parts = state.world.parts
    last_part = part[np.arange(count), np.maximum(depth - 1, 0)] if width else np.full(count, -1, np.int64)
    return {
        "tx_point": tx_point,
        "rx_point": rx_point,
        "inner_length": inner,
        "a": a,
        "length_rate": rate,
        "length_acceleration": bend_of(out, tx_velocity) + bend_of(home, rx_velocity),
        "instance": np.where(part >= 0, parts.instance[part], -1),
        "interaction": np.where(part >= 0, kind, -1),
        "depth": depth,
        "semantic": np.where(last_part >= 0, parts.semantic[last_part], 0),
        "rx_image": np.full((count, 3, 4), np.nan),
        "tx_velocity": tx_velocity,
        "rx_velocity": rx_velocity,
        "total": total,
    }


def _by_albedo(
    state: WorldState,
    a: npt.NDArray[np.complex128],
    kind: npt.NDArray[np.int32],
    part: npt.NDArray[np.int64],
    cosines: Sequence[Array],
    frequency: float,
) -> npt.NDArray[np.complex128]:
    """Return Sionna RT's transfers with the albedo of each rough surface in place of S^2 |Gamma|^2, shape as `a`.

    Mirrors and layers in the way keep their coherent part.

    Over both incident polarisations the engine's diffuse power is S^2 (|TE|^2 + |TM|^2), of the dry surface, at every
    surface that scatters. A path of one scattering has the same power for both; where mirrors are in the way, their
    ratio stays that of the engine. `cosines` are those of the way in and of the way out, with the surface's normal.
    """
    names = np.array(state.world.parts.material)
    ratio = np.ones(kind.shape)
    for name in np.unique(names[part[part >= 0]]):
        material = state.world.materials[str(name)]
        of_material = (part >= 0) & (names[np.maximum(part, 0)] == name)
        engine_scattered = engine_scattering(material) ** 2
        rows = of_material & (kind == SPECULAR)
        if rows.any():
            ratio[rows] = coherent_share(material, frequency, cosines[0][rows]) ** 2 / max(
                1.0 - engine_scattered, 1e-12
            )
        ratio[of_material & (kind == REFRACTION)] = material.coherence**2
        rows = of_material & (kind == DIFFUSE)
        if not rows.any():
            continue
        engine = material.with_(water_film=0.0, thickness=material.thickness or ENGINE_THICKNESS)
        te, tm = power_reflectance(engine, RADIO_FREQUENCY, cosines[0][rows])
        albedo = directional_albedo(material, frequency, *(cosine[rows] for cosine in cosines))
        ratio[rows] = 2.0 * albedo / (engine_scattered * (te + tm))
    result = a * np.sqrt(ratio.prod(axis=1))[:, None, None]
    single = np.count_nonzero(kind, axis=1) == 1
    columns = np.sum(np.abs(result[single]) ** 2, axis=1, keepdims=True)
    mean = columns.mean(axis=2, keepdims=True)
    result[single] *= np.sqrt(np.divide(mean, columns, out=np.ones_like(columns), where=columns > 1e-9 * mean))
    return result


def _rough(
    state: WorldState, a: npt.NDArray[np.complex128], part: npt.NDArray[np.int64], point: Array
) -> npt.NDArray[np.complex128]:
    """Return transfers (n, 2, 2) of single scattering with their powers, by the law of rough patches.

    Parts are those of the scatterers, points give each its random numbers.
    """
    names = np.array(state.world.parts.material)[part]
    crossed = np.zeros(len(a))
    for name in np.unique(names):
        crossed[names == name] = state.world.materials[str(name)].xpd_coefficient
    power = np.sum(np.abs(a) ** 2, axis=(1, 2)) / 2.0
    alike, across = np.sqrt(power * (1.0 - crossed)), np.sqrt(power * crossed)
    draw = uniform_hash(np.ascontiguousarray(point).view(np.int64), 0)
    return rough_matrix(alike, alike, across, draw) * np.exp(1j * np.angle(a[:, 0, 0]))[:, None, None]


def _directions(start: Array, points: Array, end: Array) -> Array:
    """Return the unit directions of travel, shape (num_paths, max_depth + 1, 3); zero where two points agree."""
    count = len(points)
    line = np.concatenate(
        [np.broadcast_to(start, (count, 3))[:, None], points, np.broadcast_to(end, (count, 3))[:, None]], axis=1
    )
    step = np.diff(line, axis=1)
    length = np.linalg.norm(step, axis=2, keepdims=True)
    return np.divide(step, length, out=np.zeros_like(step), where=length > 0.0)


def _part_of_chain(kind: npt.NDArray[np.int32], normal: Array, offset: Array, chosen: npt.NDArray[np.bool_]) -> Chain:
    return Chain((kind == SPECULAR) & chosen, (kind == REFRACTION) & chosen, normal, offset)


def _turned(rotation: Array, direction: Array) -> Array:
    """Return what turns components in the world's spherical basis into a frame's, shape (num_paths, 2, 2)."""
    return np.einsum("pai,pbi->pab", spherical_basis(rotation, direction), spherical_basis(np.eye(3), direction))
