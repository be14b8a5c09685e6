"""What an antenna pair receives between images of a radar is never less than what it hears through any mirrors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.radar.channel.sbr.rows import received
from scarl_sionna.radar.link import received_amplitude
from scarl_sionna.radar.optics.viewpoint import Viewpoint

ELEMENTS = {
    "V": None,
    "+45": (ss.AntennaElement(polarization="+45"), ss.AntennaElement(polarization="+45")),
    "circular": (ss.AntennaElement(polarization="RHC"), ss.AntennaElement(polarization="LHC")),
}


@pytest.mark.parametrize("ends", [("tx",), ("rx",), ("tx", "rx")], ids="+".join)
@pytest.mark.parametrize("antennas", ELEMENTS)
@pytest.mark.parametrize("roll_deg", [0.0, 35.0, 90.0])
def test_of_images_is_the_most_that_mirrors_leave(roll_deg: float, antennas: str, ends: tuple[str, ...]) -> None:
    """Over all that mirrors may make of the fields, the largest is what stands there, and none is larger."""
    rng = np.random.default_rng(5)
    radar = ss.RadarSpec()
    if (elements := ELEMENTS[antennas]) is not None:
        radar = radar.with_(
            tx_elements=(elements[0],) * radar.num_tx,
            rx_elements=(elements[1],) * radar.num_rx,
        )
    pose = Pose.from_euler([1.0, 2.0, 0.7], yaw=0.3, pitch=0.1, roll=np.radians(roll_deg))
    normal = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
    place = mirror @ pose.position + 2.0 * 6.0 * normal
    count = 12
    points = place + rng.normal(size=(count, 3)) * 3.0 - 9.0 * normal
    a = rng.normal(size=(count, 2, 2)) + 1j * rng.normal(size=(count, 2, 2))
    real = Viewpoint.of(radar, pose, np.zeros(3))
    image = replace(
        Viewpoint.of(radar, Pose.from_rotation(place, pose.rotation), np.zeros(3)), axes=mirror @ pose.rotation
    )
    tx, rx = (image if end in ends else real for end in ("tx", "rx"))
    found = received({"a": a, "tx_point": points, "rx_point": points[::-1]}, radar, tx, rx)

    vectors, most = [], np.zeros(count)
    for station, end in ((tx, points), (rx, points[::-1])):
        axes = pose.rotation if station is real else mirror @ pose.rotation
        vectors.append((end - station.pose.position) @ axes)
    for _ in range(600):  # unitary matrices in the place of the mirrors
        turns = [
            np.linalg.qr(rng.normal(size=(count, 2, 2)) + 1j * rng.normal(size=(count, 2, 2)))[0]
            if end in ends
            else np.eye(2)
            for end in ("rx", "tx")
        ]
        most = np.maximum(most, np.abs(received_amplitude(turns[0] @ a @ turns[1], *vectors, radar)))
    assert np.all(most <= found * (1.0 + 1e-9))
    assert np.all(most >= found * 0.75)


def test_of_a_real_station_is_what_it_receives() -> None:
    rng = np.random.default_rng(6)
    radar, pose = ss.RadarSpec(), Pose.from_euler([1.0, 2.0, 0.7], yaw=0.3)
    a = rng.normal(size=(9, 2, 2)) + 1j * rng.normal(size=(9, 2, 2))
    points = pose.position + rng.normal(size=(9, 3)) + 5.0 * pose.rotation[:, 0]
    station = Viewpoint.of(radar, pose, np.zeros(3))
    found = received({"a": a, "tx_point": points, "rx_point": points}, radar, station, station)
    own = (points - pose.position) @ pose.rotation
    np.testing.assert_allclose(found, np.abs(received_amplitude(a, own, own, radar)), rtol=1e-12)
