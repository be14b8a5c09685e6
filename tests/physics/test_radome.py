"""Radome or bumper: transmission by angle, polarisation and antenna, and its echo, against independent layers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.radome import _reflection_point, radome_echo
from scarl_sionna.scene.materials.dielectrics import water_permittivity
from tests.oracles import antennas as oracle
from tests.oracles import layers as exact

SKIN = ss.RadomeLayer(thickness=0.4e-3, relative_permittivity=3.5, loss_tangent=0.02)
FOAM = ss.RadomeLayer(thickness=2.7e-3, relative_permittivity=1.15, loss_tangent=0.003)
BUMPER = ss.RadomeLayer(thickness=3e-3, relative_permittivity=2.35, loss_tangent=0.001)
NOTHING = ss.RadomeLayer(thickness=0.0, relative_permittivity=4.0, loss_tangent=0.1)
AIR = ss.RadomeLayer(thickness=3e-3, relative_permittivity=1.0)
DIPOLE = {"kind": "dipole"}
PLAIN = ss.RadarSpec().with_(num_chirps=4, num_samples=64, bandwidth=150e6, pattern={"kind": "isotropic"})
WET = ss.Radome(layers=(SKIN, FOAM, SKIN), water_film=0.15e-3, tilt_deg=12.0, yaw_deg=-20.0, distance=0.04)


def stack(radome, frequency):
    """Permittivities and depths from the radar outwards."""
    eps = [one.relative_permittivity * (1.0 - 1j * one.loss_tangent) for one in radome.layers]
    depth = [one.thickness for one in radome.layers]
    if radome.water_film:
        eps, depth = [*eps, water_permittivity(frequency, 283.15)], [*depth, radome.water_film]
    return eps, depth


def normal_of(radome):
    yaw, tilt = np.radians([radome.yaw_deg, radome.tilt_deg])
    return np.array([np.cos(tilt) * np.cos(yaw), np.cos(tilt) * np.sin(yaw), np.sin(tilt)])


def screened(field, direction, normal, radome, frequency):
    """A field (3,) towards a direction behind plane layers: parts times t e^{j k h cos}."""
    eps, depth = stack(radome, frequency)
    cosine = float(direction @ normal)
    _, (te, tm) = exact.layers(eps, depth, cosine, frequency)
    turn = np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT * sum(depth) * cosine)
    s, p = exact.shares(direction, normal)
    return turn * (te * (s @ field) * s + tm * (p @ field) * p)


def test_tilted_wet_layers_pass_what_the_characteristic_matrix_says():
    """A dipole and a loop, each turned, through three layers and water: all parts of every pair, 1e-9."""
    turns = [(20.0, -10.0, 50.0), (-30.0, 5.0, 75.0)]
    elements = [
        ss.AntennaElement(
            pattern=DIPOLE, polarization=kind, boresight_azimuth_deg=a, boresight_elevation_deg=e, roll_deg=r
        )
        for kind, (a, e, r) in zip("VH", turns, strict=True)
    ]
    radar = PLAIN.with_(tx_elements=elements[:1], rx_elements=elements[1:], radome=WET)
    rng = np.random.default_rng(1)
    angles = rng.uniform(-0.7, 0.7, (30, 2))
    places = 25.0 * np.stack([np.ones(30), *angles.T], axis=1)
    paths = ss.point_targets(places, np.zeros((30, 3)), 1.0, radar, Pose())
    geometry, frequency = PathGeometry.of(paths, radar), radar.center_frequency
    axes = [oracle.turned(*turn)[:, 2] for turn in turns]
    for row, u in enumerate(oracle.unit(places)):
        sent, heard = oracle.dipole(-axes[0], u), oracle.loop(axes[1], u)
        sent, heard = (screened(field, u, normal_of(WET), WET, frequency) for field in (sent, heard))
        expected = np.sqrt(dbm_to_watt(12.0)) * abs(paths.a[row, 0, 0]) * (heard @ sent)
        assert abs(geometry.at_centers(1, 2)[row] - np.conj(expected)) < 1e-9 * abs(paths.a[row, 0, 0])


@pytest.mark.parametrize("layer", [NOTHING, AIR], ids=["no thickness", "air"])
@pytest.mark.parametrize("radius", [None, 0.4])
def test_a_radome_that_is_none_changes_nothing(layer, radius):
    radome = ss.Radome(layers=(layer,), tilt_deg=15.0, radius=radius)
    effect = ss.radome_effect(PLAIN.with_(radome=radome), np.linspace(-1.2, 1.2, 25))
    assert np.abs(effect.loss_db).max() < 1e-12 and np.abs(effect.phase_deg).max() < 1e-11
    assert (radome_echo(PLAIN.with_(radome=radome)).amplitude == 0.0).all() or effect.echo_db.max() < -280.0
    assert "radome" not in PLAIN.model_dump_json() and PLAIN.array.is_uniform


@pytest.mark.parametrize("bend", ["cylinder", "sphere"])
def test_bent_layers_are_met_where_the_rays_of_each_antenna_do(bend):
    """Crossings by root finding of the face's height; the normal by its differences; phases between antennas."""
    radome = ss.Radome(layers=(BUMPER,), radius=0.3, bend=bend, tilt_deg=8.0, yaw_deg=10.0, distance=0.05)
    radar = PLAIN.with_(radome=radome)
    u = oracle.unit(np.array([[1.0, 0.5, 0.2], [1.0, -0.9, -0.1]]))
    fields = []
    for place in radar.tx_array:
        for one in u:
            found = brentq(lambda t, p=place, d=one: float(radome.heights(p + t * d)), 0.0, 1.0, xtol=1e-14)
            assert float(radome.crossings(place, one)) == pytest.approx(found, abs=1e-12)
            point = place + found * one
            steps = 1e-6 * np.eye(3)
            slope = [float(radome.heights(point + s) - radome.heights(point - s)) / 2e-6 for s in steps]
            v = oracle.sphere_basis(one)[0]
            fields.append(screened(v, one, np.array(slope), radome, radar.center_frequency) @ v)
    effect = ss.radome_effect(
        radar.with_(rx_positions=radar.array.tx_positions),
        *np.stack([np.arctan2(u[:, 1], u[:, 0]), np.arcsin(u[:, 2])]),
    )
    own = effect.phase_deg[:, [0, 4, 8]]  # pairs of an antenna with itself
    field = np.array(fields).reshape(3, 2).T
    crossed = np.angle(field**2, deg=True)
    assert np.abs((own - crossed + 180.0) % 360.0 - 180.0).max() < 2.0  # cross-polar parts of the layers are left out
    assert np.ptp(own, axis=1).max() > 0.5


def test_an_antenna_in_the_middle_of_a_sphere_sees_it_at_normal_incidence_everywhere():
    one = ((0.0, 0.0, 0.0),)
    radome = ss.Radome(layers=(SKIN, FOAM, SKIN), distance=0.1, radius=0.2, bend="sphere", echo=False)
    centre = ((-0.1, 0.0, 0.0),)
    radar = PLAIN.with_(tx_positions=centre, rx_positions=centre, radome=radome)
    effect = ss.radome_effect(radar, np.linspace(-1.2, 1.2, 9)[:, None], np.linspace(-0.5, 0.5, 5))
    flat = ss.radome_effect(PLAIN.with_(tx_positions=one, rx_positions=one, radome=radome.with_(radius=None)), 0.0)
    assert np.allclose(effect.loss_db, flat.loss_db, atol=1e-9)
    assert np.allclose(effect.phase_deg, flat.phase_deg, atol=1e-9)


def test_the_echo_of_tilted_layers_is_the_image_of_each_transmitter():
    radar = PLAIN.with_(polarization="H", radome=WET)
    echo, frequency = radome_echo(radar), radar.center_frequency
    normal, eps_depth = normal_of(WET), stack(WET, radar.center_frequency)
    for tx, p in enumerate(radar.tx_array):
        for rx, q in enumerate(radar.rx_array):
            image = p + 2.0 * ((np.array([0.04, 0.0, 0.0]) - p) @ normal) * normal
            length = np.linalg.norm(q - image)
            arriving = (q - image) / length
            leaving = arriving - 2.0 * (arriving @ normal) * normal
            (te, tm), _ = exact.layers(*eps_depth, float(leaving @ normal), frequency)
            sent, heard = oracle.sphere_basis(leaving)[1], oracle.sphere_basis(-arriving)[1]
            s, p_in = exact.shares(leaving, normal)
            field = te * (s @ sent) * s + tm * (p_in @ sent) * np.cross(s, arriving)
            level = SPEED_OF_LIGHT / frequency / (4.0 * np.pi * length) * np.sqrt(dbm_to_watt(12.0))
            assert echo.length[tx, rx] == pytest.approx(length, rel=1e-12)
            assert abs(echo.amplitude[tx, rx] - level * (heard @ field)) < 1e-9 * level


@pytest.mark.parametrize("bend", ["cylinder", "sphere"])
def test_the_echo_of_bent_layers_has_the_shortest_way_and_the_spreading_of_ray_tubes(bend):
    radome = ss.Radome(layers=(BUMPER,), radius=0.15, bend=bend, tilt_deg=10.0, yaw_deg=-15.0, distance=0.05)
    p, q = np.array([0.0, -0.02, 0.004]), np.array([0.002, 0.025, -0.01])
    radar = PLAIN.with_(tx_positions=(tuple(p),), rx_positions=(tuple(q),), radome=radome, polarization="H")
    point, normal = _reflection_point(radome, p, q)
    assert abs(float(radome.heights(point))) < 1e-12
    inward, outward = (point - p) / np.linalg.norm(point - p), (q - point) / np.linalg.norm(q - point)
    assert np.allclose(outward, inward - 2.0 * (inward @ normal) * normal, atol=1e-9)

    def reflect(source, direction):
        hit = source + float(radome.crossings(source, direction)) * direction
        n = radome.normals(hit)
        return hit, direction - 2.0 * (direction @ n) * n

    spread = exact.tube_spreading(reflect, p, q, point)
    echo = radome_echo(radar)
    flat = np.linalg.norm(point - p) + np.linalg.norm(q - point)
    assert abs(spread * flat - 1.0) > 0.1  # a hollow face gathers
    (te, tm), _ = exact.layers(*stack(radome, radar.center_frequency), float(inward @ normal), radar.center_frequency)
    sent, heard = oracle.sphere_basis(inward)[1], oracle.sphere_basis(-outward)[1]
    s, p_in = exact.shares(inward, normal)
    field = heard @ (te * (s @ sent) * s + tm * (p_in @ sent) * np.cross(s, outward))
    level = radar.wavelength * radar.carrier_frequency / radar.center_frequency / (4.0 * np.pi)
    expected = level * spread * np.sqrt(dbm_to_watt(12.0)) * field
    assert abs(echo.amplitude[0, 0] / expected - 1.0) < 1e-6  # differences of neighbouring rays


@pytest.mark.parametrize("multiplexing", ["ideal", "tdm", "ddm"])
def test_the_echo_is_in_the_raw_data_of_every_pair(multiplexing):
    """As leakage of that length, level and phase would be; without echo nothing is there."""
    radar = PLAIN.with_(multiplexing=multiplexing, num_chirps=8, radome=WET)
    echo = radome_echo(radar)
    nothing = ss.point_targets(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), radar, Pose())
    adc = ss.synthesize(nothing, radar)
    if multiplexing != "ddm":
        t = np.arange(64) / radar.sample_rate
        for tx, rx in ((0, 0), (2, 3)):
            tau = echo.length[tx, rx] / SPEED_OF_LIGHT
            slope = radar.waveform.chirp_slope
            ts = radar.waveform.sweep.first + t
            cycles = radar.waveform.start_frequency * tau + slope * tau * ts - 0.5 * slope * tau**2
            beat = np.conj(echo.amplitude[tx, rx]) * np.exp(2j * np.pi * cycles)
            assert np.abs(adc[rx, tx::3] - beat).max() < 1e-5 * np.abs(beat).max()
    else:
        cube = ss.virtual_cube(
            ss.synthesize(nothing, radar.with_(multiplexing="ideal")), radar.with_(multiplexing="ideal")
        )
        levels = np.abs(cube[:, 0, 0])
        assert levels == pytest.approx(np.abs(echo.amplitude).ravel(), rel=1e-5)
        assert np.abs(adc).max() > 0.5 * levels.max()
    silent = radar.with_(radome=WET.with_(echo=False))
    assert not ss.synthesize(nothing, silent).any()


def test_a_wet_bumper_dims_echoes_by_its_two_way_loss():
    radome = ss.Radome(layers=(BUMPER,), water_film=0.1e-3, echo=False)
    radar, place = PLAIN.with_(radome=radome), [[20.0, 8.0, 1.0]]
    paths = ss.point_targets(place, np.zeros((1, 3)), 10.0, radar, Pose())
    loss = ss.radome_effect(radar, np.arctan2(8.0, 20.0), np.arctan2(1.0, np.hypot(20.0, 8.0))).loss_db
    dry, wet = (np.mean(np.abs(ss.synthesize(paths, some, method="direct")) ** 2) for some in (PLAIN, radar))
    assert 10.0 * np.log10(dry / wet) == pytest.approx(float(loss), abs=0.01) and loss > 5.0


def test_ramps_with_codes_see_one_frequency():
    """Fast and plain sum agree; the carriers of a code do not see other layers."""
    thick = ss.RadomeLayer(thickness=0.02, relative_permittivity=3.0)
    shape = ss.PcFmcw(coding="within", num_chirps=4, num_samples=64)
    radar = ss.RadarSpec(waveform=shape).with_(radome=ss.Radome(layers=(thick,), echo=False))
    paths = ss.point_targets([[9.0, 2.0, 0.0]], [[3.0, 0.0, 0.0]], 1.0, radar, Pose())
    fast, plain = (ss.synthesize(paths, radar, method=name) for name in ("nufft", "direct"))
    assert np.abs(fast - plain).max() < 2e-3 * np.abs(plain).max()


def test_a_network_hears_a_radome_only_by_its_own_radar():
    network = ss.RadarNetwork(PLAIN.with_(radome=WET), (Pose(), Pose([0.0, 3.0, 0.0])))
    none = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    frame = ss.synthesize_network(ss.network_paths(network, points=none), network)
    assert frame.adc[0, 0].any() and not frame.adc[0, 1].any()


def test_places_that_make_no_radome_are_refused():
    with pytest.raises(ParameterRangeError, match="mm beyond its face"):
        PLAIN.with_(radome=ss.Radome(layers=(BUMPER,), distance=0.002, yaw_deg=50.0))
    with pytest.raises(ParameterRangeError, match="at least twice the distance"):
        ss.Radome(layers=(BUMPER,), distance=0.1, radius=0.15)
    with pytest.raises(ParameterRangeError, match="less tilt_deg and yaw_deg"):
        PLAIN.with_(radome=ss.Radome(layers=(BUMPER,), tilt_deg=75.0, yaw_deg=75.0, distance=1.0))
    centre = ((-0.1, 0.0, 0.0),)
    sphere = ss.Radome(layers=(BUMPER,), distance=0.1, radius=0.2, bend="sphere")
    with pytest.raises(ParameterRangeError, match="comes to a focus"):
        radome_echo(PLAIN.with_(tx_positions=centre, rx_positions=centre, radome=sphere))
    with pytest.raises(ParameterRangeError, match="a Radome"):
        ss.radome_effect(PLAIN, 0.0)
    with pytest.raises(ParameterRangeError, match="echo=False"):
        ss.synthesize_blocks(lambda t: None, PLAIN.with_(radome=WET), 1)
