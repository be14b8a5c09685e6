"""Whether the speeds and headings that a file states are those of its positions and times: so are its units."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning, TrajectoryFileError

Array = npt.NDArray[np.float64]

MOVES = 0.5
"""Speed from which a step counts, as stated or as gone [m/s]."""
FEWEST = 3
"""Steps of all actors that are needed for a comparison."""
OFF, WRONG = 1.25, 3.0
"""Ratio of the speeds from which there is a warning, and from which the file is refused."""
OFF_COURSE, SURE = 25.0, 5.0
"""Median angle between headings and course from which there is a warning, and below which one explains it [deg]."""
LONG_STEP, CREEPING = 5.0, 0.2
"""Time between samples [s] beyond which, at speeds [m/s] below the other, a time is hardly in seconds."""


class StatedTrack(NamedTuple):
    """What a file says of one actor: times (N,) [s], plan (N, 2) [m], speeds (N,) [m/s], headings (N,) [rad].

    Speeds and headings are None where there are none, single ones nan.
    """

    times: Array
    plan: Array
    speed: Array | None
    heading: Array | None


def check_stated(path: Path, tracks: Sequence[StatedTrack], speed: str = "speed", heading: str = "yaw_deg") -> None:
    """Compare stated speeds and headings with the motion of all actors of a file.

    Parameters
    ----------
    path : Path
    tracks : sequence of StatedTrack
    speed, heading : str
        Names of the columns or attributes, for messages.

    Raises
    ------
    TrajectoryFileError
        If the median speed of what moves is three times that stated or a third of it, or headings are in radians.

    Warns
    -----
    ScarlWarning
        If speeds differ by a quarter in the median or headings by 25 deg (going backwards is none), or samples are more
        than 5 s apart where nothing is faster than 0.2 m/s.

    Notes
    -----
    By definition: medians over the steps of all actors, so that single errors and jumps of a file do not count. Tracks
    whose times do not rise strictly are not compared.
    """
    steps = [_steps(track) for track in tracks if len(track.times) > 1 and np.all(np.diff(track.times) > 0.0)]
    if not steps:
        return
    taken, gone, stated, course, headed = (np.concatenate(part) for part in zip(*steps, strict=True))
    rate = gone / taken
    _check_speeds(path, speed, rate, stated)
    _check_headings(path, heading, course[(rate > MOVES) & (gone > 0.1)], headed[(rate > MOVES) & (gone > 0.1)])
    if np.isnan(stated).all() and gone.sum() > 1.0 and np.median(taken) > LONG_STEP and rate.max() < CREEPING:
        warnings.warn(
            f"{path}: samples are {np.median(taken):.4g} s apart and nothing is faster than {rate.max():.2g} m/s; "
            "times are read as seconds and positions as metres",
            ScarlWarning,
            stacklevel=3,
        )


def _steps(track: StatedTrack) -> tuple[Array, Array, Array, Array, Array]:
    """Return times [s], lengths [m], stated speeds [m/s], courses, stated headings [rad] of steps; nan: not stated."""
    step = np.diff(track.plan, axis=0)
    none = np.full(len(step), np.nan)
    speed = none if track.speed is None else 0.5 * (np.abs(track.speed[1:]) + np.abs(track.speed[:-1]))
    turned = None if track.heading is None else np.unwrap(track.heading)
    headed = none if turned is None else 0.5 * (turned[1:] + turned[:-1])
    return np.diff(track.times), np.hypot(*step.T), speed, np.arctan2(step[:, 1], step[:, 0]), headed


def _check_speeds(path: Path, column: str, rate: Array, stated: Array) -> None:
    moving = np.maximum(rate, stated) > MOVES  # False where nothing is stated
    if moving.sum() < FEWEST:
        return
    ratio = float(np.median(rate[moving] / np.maximum(stated[moving], 1e-9)))
    if 1.0 / OFF <= ratio <= OFF:
        return
    said = (
        f"says {np.median(stated[moving]):.3g} m/s in the median, positions and times make "
        f"{np.median(rate[moving]):.3g} m/s"
    )
    if not 1.0 / WRONG <= ratio <= WRONG:
        raise TrajectoryFileError(
            said, path, "give positions in metres (not degrees), times in seconds and speeds in m/s", column=column
        )
    warnings.warn(f"{path}: '{column}' {said}; the motion is that of the positions", ScarlWarning, stacklevel=4)


def _check_headings(path: Path, column: str, course: Array, headed: Array) -> None:
    reading = "degrees clockwise from north" if column == "angle" else "degrees anticlockwise from x"
    if len(course) < FEWEST or np.isnan(headed).all():
        return
    off = _apart(headed, course)
    if off < SURE:
        return
    own = f"is {off:.0f} deg off the course of the positions in the median"
    may_be_radians = np.nanmax(np.abs(np.degrees(headed))) < 2.5 * np.pi
    if off > 3.0 * SURE and may_be_radians and _apart(np.degrees(headed), course) < SURE:
        raise TrajectoryFileError(f"{own}, and not if it is in radians", path, "give it in degrees", column=column)
    if off > OFF_COURSE:
        warnings.warn(f"{path}: '{column}' {own}; it is read as {reading}", ScarlWarning, stacklevel=4)


def _apart(headed: Array, course: Array) -> float:
    """Return the median angle between headings and courses [rad], either way round [deg]."""
    away = np.abs(np.remainder(headed - course + np.pi, 2.0 * np.pi) - np.pi)
    return float(np.degrees(np.nanmedian(np.minimum(away, np.pi - away))))
