"""Paths through point scatterers from legs: every way there with every way back, once or twice off the same point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.point_scatterers import POINT_INTERACTION, PointScatterers
from scarl_sionna.signal.link import spreading

from .legs import Legs

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Index = npt.NDArray[np.int64]


def scattered_columns(
    state: WorldState, wavelength: float, points: PointScatterers, there: Legs, back: Legs, between: Legs | None = None
) -> dict[str, npt.NDArray[Any]]:
    r"""Return the columns of :class:`RadarPaths` for paths through scatterers, and ``total`` [m].

    Parameters
    ----------
    state : WorldState
    wavelength : float
        [m].
    points : PointScatterers
    there, back : Legs
        From the transmitter and from the receiver to the points.
    between : Legs, optional
        From each point by mirrors back to itself: the paths are then those that scatter at the point twice.

    Notes
    -----
    .. math:: a = \frac{\lambda}{4\pi} \frac{J_2^T J_1}{L_1 L_2} \sqrt{\frac{\sigma}{4\pi}}, \quad
              a = \frac{\lambda}{4\pi} \frac{J_2^T J_m J_1}{L_1 L_m L_2} \frac{\sigma}{4\pi}
    """
    count = len(points.positions)
    over_array = {}
    if between is None:
        out, home = _pairs(there.target, back.target, count)
        rows = [(there, out), (back, home)]
        transfer = np.einsum("pki,pkj->pij", back.transfer[home], there.transfer[out])
        over_array = {
            "tx_slope": np.einsum("pki,pmkj->pmij", back.transfer[home], there.slope[out]),
            "rx_slope": np.einsum("pmki,pkj->pmij", back.slope[home], there.transfer[out]),
        }
    else:
        first, second = _pairs(there.target, between.target, count)
        row, home = _pairs(there.target[first], back.target, count)
        out, middle = first[row], second[row]
        rows = [(there, out), (between, middle), (back, home)]
        transfer = np.einsum("pki,pkl,plj->pij", back.transfer[home], between.transfer[middle], there.transfer[out])
    target = there.target[out]
    length = np.stack([legs.length[chosen] for legs, chosen in rows])
    scattered = np.sqrt(points.rcs[target] / (4.0 * np.pi)) ** (len(rows) - 1)
    parts, known = state.world.parts, state.world.instances
    new = max(known, default=0) + 1 + np.arange(count)
    label = new if points.instance is None else points.instance.astype(np.int64)
    semantic = np.array(
        [known[int(number)].semantic if int(number) in known else 0 for number in label], dtype=np.uint8
    )
    met = [legs.part[chosen] for legs, chosen in rows]
    kinds = [legs.kind[chosen] for legs, chosen in rows]
    return {
        "tx_point": there.image[out],
        "rx_point": back.image[home],
        "inner_length": length[1:-1].sum(axis=0) + there.inner[out] + back.inner[home],
        "a": transfer * (scale := spreading(wavelength, *length) * scattered)[:, None, None],
        **{name: slope * scale[:, None, None, None] for name, slope in over_array.items()},
        "length_rate": sum(legs.rate[chosen] for legs, chosen in rows),
        "length_acceleration": sum(legs.acceleration[chosen] for legs, chosen in rows),
        "instance": _chained([np.where(part >= 0, parts.instance[part], -1) for part in met], label[target]),
        "interaction": _chained(
            [np.where(part >= 0, kind, -1) for part, kind in zip(met, kinds, strict=True)],
            np.full(len(target), POINT_INTERACTION),
        ),
        "depth": sum(legs.depth[chosen] for legs, chosen in rows) + (len(rows) - 1),
        "semantic": semantic[target],
        "rx_image": np.full((len(target), 3, 4), np.nan),
        "tx_velocity": there.velocity[out],
        "rx_velocity": back.velocity[home],
        "total": length.sum(axis=0),
    }


def _pairs(there: Index, back: Index, num_targets: int) -> tuple[Index, Index]:
    """Return all pairs of rows of two rising columns with the same target."""
    count = np.bincount(back, minlength=num_targets)
    first = np.concatenate([[0], np.cumsum(count)])
    repeats = count[there]
    out = np.repeat(np.arange(len(there)), repeats)
    within = np.arange(len(out)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    return out, first[there[out]] + within


def _chained(ways: list[npt.NDArray[Any]], scatterer: npt.NDArray[Any]) -> npt.NDArray[np.int32]:
    """Return labels along the way: out, scatterer, between, scatterer, back in reverse; -1 behind the last."""
    blocks = [column for way in ways[:-1] for column in (way, scatterer[:, None])]
    columns = np.concatenate([*blocks, ways[-1][:, ::-1]], axis=1)
    return np.take_along_axis(columns, np.argsort(columns == -1, axis=1, kind="stable"), axis=1).astype(np.int32)
