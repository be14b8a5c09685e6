"""Road: centre curve with a bend, pavement, lane markings, verges and the ground to the horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Array, Mesh, grid, merge

VERGE_WIDTH = 75.0
"""Width of the ground beside the pavement that follows the road [m]."""


@dataclass(frozen=True)
class RoadCurve:
    """Reference line that is straight, bends to the left, and is straight again; it runs along +x through the origin.

    Attributes
    ----------
    bend_start, bend_stop : float
        Arc lengths where the curvature begins to grow and is zero again [m].
    radius : float
        Radius of the bend [m].
    transition : float
        Length over which the curvature grows and falls (smoothstep) [m].
    """

    bend_start: float = 4.0
    bend_stop: float = 250.0
    radius: float = 150.0
    transition: float = 12.0
    start: float = -200.0
    stop: float = 400.0
    step: float = 0.02

    def __post_init__(self) -> None:
        """Integrate curvature to heading to position on a fine table (midpoint rule)."""
        s = np.arange(self.start, self.stop + self.step / 2, self.step)
        kappa = self.curvature(s + self.step / 2)
        heading = np.r_[0.0, np.cumsum(kappa[:-1]) * self.step]
        middle = heading[:-1] + kappa[:-1] * self.step / 2
        x = self.start + np.r_[0.0, np.cumsum(np.cos(middle)) * self.step]
        y = np.r_[0.0, np.cumsum(np.sin(middle)) * self.step]
        object.__setattr__(self, "_table", (s, x, y, heading))

    def curvature(self, s: Array) -> Array:
        """Return the curvature [1/m] at arc length `s` [m]; positive = to the left."""
        up = np.clip((s - self.bend_start) / self.transition, 0.0, 1.0)
        down = np.clip((self.bend_stop - s) / self.transition, 0.0, 1.0)
        return (up * up * (3 - 2 * up)) * (down * down * (3 - 2 * down)) / self.radius

    def heading(self, s: Array) -> Array:
        """Return the direction of travel [rad], from +x towards +y."""
        table = self._table  # type: ignore[attr-defined]
        return np.interp(s, table[0], table[3])

    def point(self, s: Array, offset: Array | float = 0.0, z: Array | float = 0.0) -> Array:
        """Return world points, shape (..., 3) [m], at arc length `s` and lateral `offset` [m] (positive = left)."""
        table = self._table  # type: ignore[attr-defined]
        s, offset, z = np.broadcast_arrays(np.asarray(s, float), offset, z)
        x, y, heading = (np.interp(s, table[0], column) for column in table[1:])
        return np.stack([x - offset * np.sin(heading), y + offset * np.cos(heading), z], -1)

    def lane_positions(self, start: float, offset: float, speed: float, times: Array) -> Array:
        """Return the positions, shape (num_times, 3) [m], of a car at constant speed in a lane.

        Parameters
        ----------
        start : float
            Arc length of the reference line at time 0 [m].
        offset : float
            Lateral offset of the lane [m].
        speed : float
            Speed along the lane [m/s]; negative = against the direction of the reference line.
        times : ndarray, shape (num_times,)
            Times [s], the first is 0.
        """
        fine = np.linspace(0.0, times[-1], 4000)
        s = np.empty_like(fine)
        s[0] = start
        step = fine[1]
        for k in range(len(fine) - 1):  # a lane at `offset` is (1 - curvature offset) times as long
            rate = speed / (1.0 - self.curvature(np.array(s[k])) * offset)
            rate = speed / (1.0 - self.curvature(np.array(s[k] + 0.5 * step * rate)) * offset)
            s[k + 1] = s[k] + step * rate
        return self.point(np.interp(times, fine, s), offset)


def strip(
    curve: RoadCurve, s: Array, offsets: Array, heights: Array, uv_scale: tuple[float, float] = (1.0, 1.0)
) -> Mesh:
    """Return a strip along the curve with the cross-section (`offsets`, `heights`) [m]; offsets grow to the left.

    `heights` may be (num_offsets,) or (num_s, num_offsets).  Texture: u = offset / uv_scale[0], v = s / uv_scale[1].
    """
    points = curve.point(s[:, None], offsets[None, :], np.broadcast_to(heights, (len(s), len(offsets))))
    u, v = np.broadcast_arrays(offsets[None, :] / uv_scale[0], s[:, None] / uv_scale[1])
    return grid(points, np.stack([u, v], -1))


def dashes(curve: RoadCurve, starts: Array, length: float, offset: float, width: float, height: float) -> Mesh:
    """Return marking dashes `length` x `width` [m] at lateral `offset`, `height` above the pavement [m]."""
    across = np.array([offset - width / 2, offset + width / 2])
    pieces = max(2, int(np.ceil(length / 1.0)) + 1)
    return merge([strip(curve, np.linspace(a, a + length, pieces), across, np.full(2, height)) for a in starts])


def smooth_noise(x: Array, y: Array, seed: int, waves: int = 12, wavelength: float = 20.0) -> Array:
    """Return band-limited noise of unit variance at (x, y) [m]: a sum of plane waves of random direction and phase."""
    generator = np.random.default_rng(seed)
    angle, phase = generator.uniform(0, 2 * np.pi, (2, waves))
    k = 2 * np.pi / (wavelength * generator.uniform(0.6, 1.8, waves))
    total = sum(np.sin(k[i] * (x * np.cos(angle[i]) + y * np.sin(angle[i])) + phase[i]) for i in range(waves))
    return np.asarray(total) * np.sqrt(2.0 / waves)


def verge_heights(curve: RoadCurve, s: Array, offsets: Array, edge: float, seed: int) -> Array:
    """Return ground heights [m], shape (num_s, num_offsets), beside the pavement whose edge lies at `edge`.

    The ground begins 3 cm below the pavement, falls into a shallow ditch, rises again, rolls, and dives below the far
    ground at the outer end of the offsets.
    """
    distance = np.abs(offsets - edge)
    ditch = -0.03 - 0.03 * np.clip(distance / 1.5, 0, 1) - 0.32 * np.exp(-(((distance - 4.6) / 1.5) ** 2))
    rise = 0.35 * np.clip((distance - 6.0) / 25.0, 0, 1) ** 1.5
    points = curve.point(s[:, None], offsets[None, :])
    roll = 0.12 * smooth_noise(points[..., 0], points[..., 1], seed) * np.clip((distance - 2.0) / 8.0, 0, 1)
    outer = np.clip((distance - (VERGE_WIDTH - 14.0)) / 14.0, 0, 1) ** 2 * 2.6
    return ditch + rise + roll - outer


def far_height(x: Array, y: Array, seed: int, base: float = -1.4) -> Array:
    """Return the height [m] of the far ground: level at `base`, rising to hills beyond 330 m from the origin."""
    far = np.clip((np.hypot(x, y) - 330.0) / 900.0, 0, 1) ** 1.3
    hills = (
        26.0 + 15.0 * smooth_noise(x, y, seed, wavelength=700.0) + 5.0 * smooth_noise(x, y, seed + 1, wavelength=230.0)
    )
    return base + np.maximum(far * hills, 0.0)


def far_ground(radius: float, seed: int) -> Mesh:
    """Return a disc of ground to `radius` [m] with the heights of `far_height`; uv in units of 25 m."""
    r = np.concatenate([[20.0, 80.0, 160.0], np.geomspace(220.0, radius, 22)])
    angle = np.linspace(0, 2 * np.pi, 109)
    x, y = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
    points = np.stack([x, y, far_height(x, y, seed)], -1)
    points[:, -1] = points[:, 0]
    ring = grid(points, points[..., :2] / 25.0)
    middle = np.array([[0.0, 0.0, points[0, 0, 2]]])
    centre = np.vstack([points[0, :-1], middle])
    k = np.arange(len(angle) - 1)
    fan = np.stack([k, (k + 1) % len(k), np.full(len(k), len(k))], 1).astype(np.int64)
    return merge([ring, Mesh(centre, fan, centre[:, :2] / 25.0)])
