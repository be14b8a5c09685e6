"""SUMO in the loop: its traffic reacts to an ego vehicle that somebody else drives. Needs the extra ``sumo``."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.errors import SessionError, SimulatorError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Metres, Seconds
from scarl_sionna.scenario.motion.bodies import body_of
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.planned import Conversion
from scarl_sionna.scenario.traffic.recorded.fcd import heading_of_angle, model_of_type
from scarl_sionna.scenario.traffic.sumo import default_warm_up, running_sumo, sumo_errors
from scarl_sionna.scene.lanes import LaneNetwork

from .motion import ActorPose

Array = npt.NDArray[np.float64]

_ANYWHERE = 2
"""`keepRoute` of moveToXY: the ego may leave its route and the roads."""
_EGO_TYPE = "driven_from_outside"
_JUMP = 100.0
"""Who is faster was carried elsewhere by SUMO [m/s]."""


class _Seen(NamedTuple):
    """One actor after a step: its front [m, SUMO], heading [rad], and origin in the scene [m]."""

    front: Array
    heading: float
    place: Array

    def followed(self, front: Array, length: float) -> float:
        """Return the heading when the front has moved, and the rear axle, so far behind it [m], was drawn along."""
        rear = self.front[:2] - length * np.array([np.cos(self.heading), np.sin(self.heading)])
        along = front[:2] - rear
        return float(np.arctan2(along[1], along[0]))


def _half_turn(angle: float) -> float:
    """Return an angle within half a turn of 0 [rad]."""
    return float(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


class SumoSettings(Spec):
    """How SUMO is stepped, and its ego vehicle."""

    step: Seconds = Field(0.05, ge=0.01, le=1.0, description="time of a step [s]")
    duration: Seconds = Field(600.0, gt=0.0, description="for lanes: how long vehicles enter [s]")
    warm_up: Seconds | None = Field(
        None, ge=0.0, description="time before the first step [s]; None: 30 s for lanes, 0 for a configuration"
    )
    ego: str = Field("ego", description="name of the ego vehicle")
    ego_length: Metres = Field(4.5, gt=0.0, description="of the ego as others see it [m]")
    ego_width: Metres = Field(1.8, gt=0.0, description="of the ego as others see it [m]")


class SumoTraffic:
    """SUMO's vehicles and people, stepped beside a session; they see the ego vehicle where it was told to be.

    Parameters
    ----------
    source : str, Path or LaneNetwork
        A ``.sumocfg``, or lanes, as :func:`scarl_sionna.scenario.traffic.sumo.run_sumo` takes.
    traffic : TrafficSpec, optional
        Seed; for lanes also density and mix.
    settings : SumoSettings, optional
    conversion : Conversion, optional
        Types to models, ground and offset.
    most : mapping of str to int, optional
        How many actors of a model are told, those nearest the ego: `SessionSettings.bodies`. None: all.

    Raises
    ------
    ParameterRangeError
        If a number is outside its range.
    MissingPackageError
        If libsumo is not installed.
    SessionError
        If SUMO already runs in this process: libsumo holds one simulation.
    SimulatorError
        If SUMO refuses its input.

    Notes
    -----
    The ego is put where it is by ``moveToXY`` before each step [1]_; others react to it one step later, as they do to
    each other. SUMO says where the middle of the front bumper is. The rear axle follows it as a trailer does, which
    makes headings and turns smooth where a lane is of straight pieces; pitch is the slope of the road. A vehicle goes
    on with the velocity that it had in SUMO's last step.

    References
    ----------
    .. [1] SUMO documentation, *TraCI/Change Vehicle State*, move to XY.
    """

    def __init__(
        self,
        source: str | Path | LaneNetwork,
        traffic: TrafficSpec | None = None,
        settings: SumoSettings | None = None,
        *,
        conversion: Conversion | None = None,
        most: Mapping[str, int] | None = None,
    ) -> None:
        settings = settings or SumoSettings()
        warm = default_warm_up(source) if settings.warm_up is None else settings.warm_up
        self.settings, self.most, self._seconds = settings, most, settings.step
        self._num_steps, self._seen = 0, dict[str, _Seen]()
        _check_free()
        self._open = ExitStack()
        horizon = warm + settings.duration
        running = running_sumo(source, traffic or TrafficSpec(), settings.step, horizon, conversion or Conversion())
        self._sumo: ModuleType | None = None
        self._sumo, self._conversion = self._open.enter_context(running)
        self._heights = self._conversion.heights()
        try:
            for _ in range(round(warm / settings.step)):
                self._advance()
        except SimulatorError:
            self.close()
            raise

    @property
    def time(self) -> float:
        """Time of the last step [s]; 0 at the end of the warm-up."""
        return self._num_steps * self._seconds

    def step(self, ego: Pose | ActorPose | None = None) -> dict[str, ActorPose]:
        """Advance SUMO by one step and return what `Session.step` takes for its new :attr:`time`.

        Parameters
        ----------
        ego : Pose or ActorPose, optional
            Where the ego is at the end of the step, world_from_actor; None: it is not there.

        Returns
        -------
        dict of str to ActorPose
            All who are there by SUMO's names, and the ego as it was given.

        Raises
        ------
        SessionError
            If it is closed.
        SimulatorError
            If SUMO stops.
        """
        if self._sumo is None:
            raise SessionError("SUMO's traffic is closed; make another one")
        given = ActorPose(ego) if isinstance(ego, Pose) else ego
        with sumo_errors(self._sumo):
            self._place(given)
        self._advance()
        self._num_steps += 1
        with sumo_errors(self._sumo):
            others = self._others()
        if given is None:
            return others
        return {**self._nearest(others, given.pose), self.settings.ego: given}

    def _advance(self) -> None:
        with sumo_errors(self._simulation):
            self._simulation.simulationStep()

    @property
    def _simulation(self) -> ModuleType:
        assert self._sumo is not None
        return self._sumo

    def _place(self, ego: ActorPose | None) -> None:
        """Say where the ego will be: the middle of its front bumper."""
        sumo, name = self._simulation, self.settings.ego
        is_there = name in sumo.vehicle.getIDList()
        if ego is None:
            if is_there:
                sumo.vehicle.remove(name)
            return
        if not is_there:
            if _EGO_TYPE not in sumo.vehicletype.getIDList():
                sumo.vehicletype.copy("DEFAULT_VEHTYPE", _EGO_TYPE)
                sumo.vehicletype.setLength(_EGO_TYPE, self.settings.ego_length)
                sumo.vehicletype.setWidth(_EGO_TYPE, self.settings.ego_width)
            sumo.vehicle.add(name, "", typeID=_EGO_TYPE)
        forward = ego.pose.rotation[:, 0]
        x, y = (ego.pose.position + 0.5 * self.settings.ego_length * forward)[:2] - np.asarray(self._conversion.offset)
        angle = 90.0 - np.degrees(np.arctan2(forward[1], forward[0]))
        sumo.vehicle.moveToXY(name, "", -1, float(x), float(y), float(angle % 360.0), _ANYWHERE)

    def _others(self) -> dict[str, ActorPose]:
        sumo, found, seen = self._simulation, dict[str, ActorPose](), dict[str, _Seen]()
        for domain, is_person in ((sumo.vehicle, False), (sumo.person, True)):
            for name in domain.getIDList():
                if name != self.settings.ego:
                    found[name], seen[name] = self._actor(domain, name, is_person)
        self._seen = seen
        return found

    def _actor(self, domain: Any, name: str, is_person: bool) -> tuple[ActorPose, _Seen]:  # noqa: ANN401  # of libsumo
        conversion, kind = self._conversion, domain.getTypeID(name)
        model = (conversion.types or {}).get(kind) or model_of_type(kind, is_person)
        front, said = np.array(domain.getPosition3D(name)), heading_of_angle(domain.getAngle(name))
        body = body_of(model, conversion.models)
        middle = 0.0 if is_person else 0.5 * body.length
        before = self._seen.get(name)
        if before is not None and np.linalg.norm(front - before.front) > _JUMP * self._seconds:
            before = None
        heading = said if before is None or is_person else before.followed(front, middle - body.rear_axle)
        turned = Pose.from_euler([0.0, 0.0, 0.0], yaw=heading, pitch=-float(np.radians(domain.getSlope(name))))
        place = front - middle * turned.rotation[:, 0]
        place[:2] += conversion.offset
        if self._heights is not None:
            place[2] = self._heights(place[None, :2])[0]
        if before is None:
            twist = Twist(domain.getSpeed(name) * turned.rotation[:, 0])
        else:
            turn = _half_turn(heading - before.heading)
            twist = Twist((place - before.place) / self._seconds, np.array([0.0, 0.0, turn / self._seconds]))
        return ActorPose(Pose(place, turned.quaternion), twist, model), _Seen(front, heading, place)

    def _nearest(self, others: dict[str, ActorPose], ego: Pose) -> dict[str, ActorPose]:
        """Leave out the farthest of each model of which there are too many."""
        if self.most is None:
            return others
        far = {name: float(np.linalg.norm(one.pose.position - ego.position)) for name, one in others.items()}
        count, kept = dict[str, int](), set[str]()
        for name in sorted(others, key=far.__getitem__):
            model = str(others[name].body)
            count[model] = count.get(model, 0) + 1
            if count[model] <= self.most.get(model, count[model]):
                kept.add(name)
        return {name: one for name, one in others.items() if name in kept}

    def close(self) -> None:
        """End SUMO; another one can start then."""
        self._sumo = None
        self._open.close()

    def __enter__(self) -> SumoTraffic:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _check_free() -> None:
    try:
        import libsumo
    except ImportError:
        return  # said with its remedy when SUMO starts
    if libsumo.isLoaded():
        raise SessionError("SUMO already runs in this process; close the other traffic first")
