"""Traffic by SUMO, in this process (libsumo): from a configuration of SUMO's, or on the lanes of a scene."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np

from scarl_sionna.core.errors import MissingPackageError, ParameterRangeError, ScarlError, SimulatorError
from scarl_sionna.core.seeds import generator
from scarl_sionna.scenario.motion.bodies import BodyLike, body_of
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scene.lanes import LaneNetwork

from .planned import Conversion, PlannedActor
from .recorded.fcd import Samples, planned_from_samples
from .separation import without_collisions
from .simulated import DEFAULT_MIX, TOP_SPEED
from .sumo_network import SumoNetwork, write_sumo_network

_TOUCH = 0.1
"""Overlap of two boxes that may come from the smoothing of their motion [m]."""
_OPTIONS = (
    *("--lanechange.duration", "3", "--time-to-teleport", "-1", "--no-step-log", "true", "--no-warnings", "true"),
    *("--duration-log.disable", "true", "--collision.action", "warn"),
)
_LEAD = 3.0
"""Part of the warm-up that is recorded, too: the rear axle follows the way of before [s]."""


def run_sumo(
    source: str | Path | LaneNetwork,
    span: tuple[float, float],
    traffic: TrafficSpec | None = None,
    *,
    step: float = 0.1,
    warm_up: float | None = None,
    conversion: Conversion | None = None,
) -> list[PlannedActor]:
    """Run SUMO and return the smooth motion of all that took part.

    Parameters
    ----------
    source : str, Path or LaneNetwork
        A ``.sumocfg`` of SUMO, or lanes: these become a network of SUMO (:func:`write_sumo_network`), with random
        vehicles that enter at its open ends.
    span : (float, float)
        First and last time of the record [s].
    traffic : TrafficSpec or None
        `seed` of SUMO and of the random vehicles (same seed, same bytes). For lanes also `density` of the vehicles that
        enter, vehicles/km at the speed limit [1/km], and `mix`, shares of actor models by name. Its other fields are
        not looked at.
    step : float
        Step of SUMO [s], 0.01 to 1.
    warm_up : float or None
        Time that is simulated before the record [s]; None: 30 s for lanes, 0 for a configuration.
    conversion : Conversion or None
        From SUMO's vehicles to actors; lanes are their own ground, and know no other types.

    Returns
    -------
    list of PlannedActor
        All are known for the whole span: who enters later or leaves earlier goes straight on beyond the
        scene; `active` is the time in SUMO.

    Raises
    ------
    ParameterRangeError
        If a number is outside its range.
    MissingPackageError
        If libsumo is not installed (``pip install 'scarl-sionna[sumo]'``).
    SimulatorError
        If SUMO refuses its input or stops.

    Warns
    -----
    ScarlWarning
        If two would touch, the later one is left out: SUMO does not keep all vehicles apart inside junctions.

    Notes
    -----
    Krauss's car following and SUMO's lane changes, drawn out over 3 s (``lanechange.duration``), without teleports
    [1]_.

    References
    ----------
    .. [1] P. A. Lopez et al., Microscopic traffic simulation using SUMO, IEEE ITSC 2018.
    """
    traffic, conversion = traffic or TrafficSpec(), conversion or Conversion()
    start_time, duration = span[0], span[1] - span[0]
    if not 1e-3 <= duration <= 86400.0:
        raise ParameterRangeError("span", span, "a start, and a stop 0.001 to 86400 s later")
    warm = default_warm_up(source) if warm_up is None else warm_up
    with running_sumo(source, traffic, step, warm + duration, conversion) as (libsumo, conversion):
        samples, kinds = _record(libsumo, warm, duration, step, start_time)
    actors = planned_from_samples(samples, kinds, (start_time, start_time + duration), conversion)
    return without_collisions(actors, np.arange(start_time, start_time + duration, 0.1), tolerance=_TOUCH)


def default_warm_up(source: str | Path | LaneNetwork) -> float:
    """Return the time that SUMO runs before anybody looks [s]: vehicles that enter lanes need some to spread."""
    return 30.0 if isinstance(source, LaneNetwork) else 0.0


@contextmanager
def running_sumo(
    source: str | Path | LaneNetwork, traffic: TrafficSpec, step: float, horizon: float, conversion: Conversion
) -> Iterator[tuple[ModuleType, Conversion]]:
    """Start SUMO in this process and close it at the end.

    Parameters
    ----------
    source, traffic, step, conversion
        As of :func:`run_sumo`.
    horizon : float
        Time for which random vehicles enter [s].

    Yields
    ------
    libsumo : module
    conversion : Conversion
        With the ground of the lanes.

    Raises
    ------
    ParameterRangeError, MissingPackageError, SimulatorError
        As :func:`run_sumo`; what libsumo raises within becomes a SimulatorError.
    """
    if not 0.01 <= step <= 1.0:
        raise ParameterRangeError("step", step, "0.01 to 1 s")
    seed = traffic.seed or 0
    if seed >= 2**31:
        raise ParameterRangeError("seed", seed, "an integer from 0 to 2147483647")
    libsumo = _libsumo()
    options = [*_OPTIONS, "--step-length", f"{step:g}", "--seed", str(seed)]
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(source, LaneNetwork):
            roads = write_sumo_network(source, folder)
            routes = _write_routes(Path(folder), roads, horizon, traffic, conversion.models)
            options = ["--net-file", str(roads.path), "--route-files", str(routes), *options]
            conversion = replace(conversion, ground=conversion.ground or source, types=None)
        else:
            if not Path(source).is_file():
                raise SimulatorError(f"configuration {source} is not there; give a .sumocfg or lanes")
            options = ["--configuration-file", str(source), *options]
        with sumo_errors(libsumo):
            libsumo.start(["sumo", *options])
            try:
                yield libsumo, conversion
            finally:
                libsumo.close()


@contextmanager
def sumo_errors(libsumo: ModuleType) -> Iterator[None]:
    """Make what libsumo raises a SimulatorError."""
    try:
        yield
    except ScarlError:
        raise
    except (libsumo.TraCIException, libsumo.FatalTraCIError, RuntimeError) as error:
        raise SimulatorError(f"SUMO stopped: {error}") from error


def _libsumo() -> ModuleType:
    try:
        import libsumo
    except ImportError as error:
        raise MissingPackageError("libsumo", "sumo") from error
    return libsumo


def _record(
    libsumo: ModuleType, warm_up: float, duration: float, step: float, start_time: float
) -> tuple[Samples, dict[str, tuple[str, bool]]]:
    """Run SUMO and return the samples of vehicles and people."""
    samples: Samples = {}
    kinds: dict[str, tuple[str, bool]] = {}
    first, last = round(warm_up / step), round((warm_up + duration) / step)
    early = max(first - round(_LEAD / step), 0)
    for index in range(last + 1):
        libsumo.simulationStep()
        if index < early:
            continue
        time = start_time + (index - first) * step
        for domain, is_person in ((libsumo.vehicle, False), (libsumo.person, True)):
            for name in domain.getIDList():
                x, y, z = domain.getPosition3D(name)
                samples.setdefault(name, []).append((time, x, y, z if abs(z) < 1e5 else 0.0, domain.getAngle(name)))
                kinds[name] = (domain.getTypeID(name), is_person)
    seen = {name: rows for name, rows in samples.items() if len(rows) > 1 and rows[-1][0] > start_time}
    return seen, kinds


def _write_routes(
    folder: Path,
    roads: SumoNetwork,
    duration: float,
    traffic: TrafficSpec,
    models: Mapping[str, BodyLike] | None,
) -> Path:
    """Write vehicles that enter at the open ends at random times, each on a random route."""
    draw, mix = generator(traffic.seed or 0, "sumo_routes"), traffic.mix or DEFAULT_MIX
    root = ET.Element("routes")
    names = sorted(mix)
    for model in names:
        body = body_of(model, models)
        values = {
            "id": model,
            "vClass": "bicycle"
            if model in ("bicycle", "cargo_bike")
            else "truck"
            if model in ("lorry", "articulated_lorry", "bus", "coach")
            else "passenger",
            "length": f"{body.length:.3f}",
            "width": f"{body.width:.3f}",
            "height": f"{body.height:.3f}",
            "minGap": "2.0",
            "accel": "1.2" if body.length > 7.0 else "2.0",
            "decel": "4.0",
            "emergencyDecel": "8.0",
            "sigma": "0.4",
            "tau": "1.2",
            "maxSpeed": f"{TOP_SPEED.get(model, 55.0):g}",
            "speedFactor": "normc(1,0.06,0.85,1.15)",
        }
        ET.SubElement(root, "vType", values)
    weights = np.array([mix[name] for name in names], dtype=np.float64)
    entries = roads.entries or tuple(sorted(roads.length))
    departures = []
    for edge in entries:
        rate = traffic.density / 1000.0 * roads.speed[edge] / (1.0 if roads.entries else len(entries))
        time = 0.0
        while rate > 0.0 and (time := time + 1.5 + float(draw.exponential(1.0 / rate))) < duration:
            route, way = [edge], roads.length[edge]
            while roads.next[route[-1]] and way < 40.0 * (duration - time) + 100.0:
                ways = roads.next[route[-1]]
                route.append(ways[int(draw.integers(len(ways)))])
                way += roads.length[route[-1]]
            model = names[int(draw.choice(len(names), p=weights / weights.sum()))]
            departures.append((time, model, route))
    for number, (time, model, route) in enumerate(sorted(departures, key=lambda row: (row[0], row[2][0]))):
        values = {
            "id": f"sumo_{number}",
            "type": model,
            "depart": f"{time:.2f}",
            "departSpeed": "max",
            "departLane": "best",
        }
        vehicle = ET.SubElement(root, "vehicle", values | {"departPos": "base" if roads.entries else "random_free"})
        ET.SubElement(vehicle, "route", {"edges": " ".join(route)})
    path = folder / "lanes.rou.xml"
    ET.indent(root)
    path.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    return path
