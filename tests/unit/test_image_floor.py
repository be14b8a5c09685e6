"""What an antenna pair receives between images of a radar is judged with the antennas' own mirrored axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.radar.channel.sbr.rows import received
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.signal.antenna import spherical_basis


@pytest.mark.parametrize("roll_deg", [0.0, 35.0, 90.0])
def test_of_an_image_is_that_of_the_radar_before_a_lossless_mirror(roll_deg: float) -> None:
    """The field that arrives at the image, mirrored, is what the radar itself receives, whatever the image's pose."""
    rng = np.random.default_rng(5)
    radar = ss.RadarSpec()
    pose = Pose.from_euler([1.0, 2.0, 0.7], yaw=0.3, pitch=0.1, roll=np.radians(roll_deg))
    normal = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
    place = mirror @ pose.position + 2.0 * 6.0 * normal
    points = place + rng.normal(size=(40, 3)) * 3.0 - 9.0 * normal
    a = rng.normal(size=(40, 2, 2)) + 1j * rng.normal(size=(40, 2, 2))
    looking = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    looking *= np.linalg.det(looking)  # any axes at all
    station = Viewpoint.of(radar, Pose.from_rotation(place, looking), np.zeros(3))
    image = replace(station, axes=mirror @ pose.rotation)
    found = received({"a": a, "tx_point": points, "rx_point": points[::-1]}, radar, image, image)

    # the same by hand: fields as vectors, mirrored, between polarisations of the radar itself
    vectors, bases = [], []
    for end in (points, points[::-1]):
        own = (end - place) @ mirror.T @ pose.rotation
        turn = np.einsum(
            "nij,kj,nlk->nil",
            spherical_basis((end - place) @ looking) @ looking.T,
            mirror,
            spherical_basis(own) @ pose.rotation.T,
        )
        vectors.append(own)
        bases.append(turn)
    turned = np.einsum("nij,njk,nkl->nil", np.swapaxes(bases[1], 1, 2), a, bases[0])
    np.testing.assert_allclose(found, np.abs(received_amplitude(turned, *vectors, radar)), rtol=1e-9, atol=1e-15)
