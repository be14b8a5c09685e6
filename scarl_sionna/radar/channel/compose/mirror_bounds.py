"""How much reflections at mirrors, the ground bounce before all, can change the echo of an object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.signal.antenna import field_gain

from .mirrors import PRESELECTION_MARGIN, Mirror

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]


class MirrorChange(NamedTuple):
    """What one mirror can do to an echo."""

    change_db: float
    """Largest rise of the object's power [dB]; a fade can be deeper."""
    instance: str
    """The mirror's instance; empty where no mirror reflects."""


def largest_mirror_change(
    state: WorldState, radar: RadarSpec, pose: Pose, mirrors: Sequence[Mirror], point: Array
) -> MirrorChange:
    r"""Return what the mirror that matters most can do to the echo of an object.

    Parameters
    ----------
    state : WorldState
    radar : RadarSpec
    pose : Pose
        Of the radar [world].
    mirrors : sequence of Mirror
    point : ndarray of float64, shape (3,)
        Middle of the object [m, world].

    Returns
    -------
    MirrorChange

    Raises
    ------
    MaterialRangeError
        If a mirror's material has no data at the carrier frequency.

    Notes
    -----
    By image theory each of the two legs has a second way, whose field is

    .. math:: \rho = |\Gamma| \sqrt{1 - S^2} \; \frac{g_m}{g} \; \frac{d}{d_m}

    of the straight one (larger of the two polarisations; gains and lengths g and d, those over the mirror with the
    index m), so the echo changes by at most :math:`40 \log_{10}(1 + \rho)`. What stands between is not looked at. The
    two-ray law is that of M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, section 8.2.
    """
    best = MirrorChange(0.0, "")
    straight = point - pose.position
    distance = float(np.linalg.norm(straight))
    gain = float(field_gain(radar.array.pattern, (straight @ pose.rotation)[None])[0])
    for mirror in mirrors:
        here, there = float(mirror.height(pose.position)), float(mirror.height(point))
        if here * there <= 0.0 or distance <= 0.0:
            continue
        way = point - 2.0 * there * mirror.normal - pose.position
        touched = pose.position + here / (here + there) * way
        if not mirror.near(touched, PRESELECTION_MARGIN * mirror.extent):
            continue
        length = float(np.linalg.norm(way))
        material = state.world.materials[state.world.parts.material[mirror.part]]
        cosine = min(abs(float(way @ mirror.normal)) / length, 1.0)
        coefficient = max(abs(complex(value)) for value in reflection(material, radar.center_frequency, cosine))
        coherent = coefficient * np.sqrt(max(1.0 - material.scattering_coefficient**2, 0.0))
        aside = float(field_gain(radar.array.pattern, (way @ pose.rotation)[None])[0])
        ratio = coherent * aside / max(gain, 1e-6) * distance / length
        change = float(40.0 * np.log10(1.0 + ratio))
        if change > best.change_db:
            instance = int(state.world.parts.instance[mirror.part])
            best = MirrorChange(change, state.world.instances[instance].name)
    return best
