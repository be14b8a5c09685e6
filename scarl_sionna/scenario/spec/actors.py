"""Who takes part in a scenario, as plain data: the ego vehicle, actors, traffic, and what is drawn at random."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, Unit
from scarl_sionna.scene.actors.body_spec import Axis, BodySpec

from .draws import DayDraw, HourDraw, VariantDraw, WeatherDraws
from .motion import TrajectorySpec

Color = Annotated[tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...], Field(min_length=3, max_length=3)]
NAME = r"^[A-Za-z][A-Za-z0-9_]*$"


class MeshSpec(Spec):
    """A mesh of your own as an actor; see `scarl_sionna.actor_from_mesh`."""

    file: str = Field(min_length=1, description="glTF, OBJ, PLY or STL, relative to the scenario's file")
    semantic: str = Field("Car", description="semantic class")
    materials: dict[str, str] = Field(
        {"*": "car_paint"}, description='radio materials by part or by material of the file, "*" for the rest'
    )
    scale: float = Field(1.0, gt=0.0, description="metres in a unit of the file")
    up: Axis | None = Field(None, description="axis of the file; default: y for glTF, else z")
    forward: Axis | None = Field(None, description="axis of the file; default: z for glTF, else x")
    motion: Literal["vehicle", "cycle", "walk", "stand"] | None = Field(None, description="default: by the class")
    wheelbase: Metres | None = Field(None, gt=0.0, description="distance of the axles [m]")
    rear_axle: Metres | None = Field(None, le=0.0, description="x of the rear axle from the middle [m]")


class BodyFileSpec(BodySpec):
    """A body of your own that bends, as an actor; see `scarl_sionna.actor_from_body`."""

    file: str = Field(min_length=1, description="skinned glTF or BVH, relative to the scenario's file")
    materials: dict[str, str] = Field(
        {"*": "clothed_skin"}, description='radio materials by part or by material of the file, "*" for the rest'
    )


class _Body(Spec):
    """What the ego vehicle and other actors share: which body, and how it looks."""

    variant: str | None = Field(None, description="a variant of the model; default: its first")
    colors: dict[str, Color] = Field({}, description="by BSDF of the model, linear RGB of 0 to 1")
    detail: Literal["light", "detailed"] | None = Field(None, description="of the mesh; default: that of the scene")


class EgoSpec(_Body):
    """The vehicle that carries the rig."""

    model: str = Field("saloon", min_length=1, description="actor model: a name, or the path of a folder")
    trajectory: TrajectorySpec | None = Field(None, description="default: the motion of the scene's own ego")


class ActorSpec(_Body):
    """One body that moves or stands."""

    name: str = Field(pattern=NAME)
    model: str | None = Field(None, min_length=1, description="actor model: a name, or the path of a folder")
    mesh: MeshSpec | None = Field(None, description="a mesh file instead of a model")
    body: BodyFileSpec | None = Field(None, description="a skinned glTF or a BVH instead of a model")
    trajectory: TrajectorySpec

    @model_validator(mode="after")
    def _check(self) -> ActorSpec:
        if sum(one is not None for one in (self.model, self.mesh, self.body)) != 1:
            raise ValueError("one of `model`, `mesh` and `body`")
        return self

    @model_serializer(mode="wrap")
    def _as_before(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave `body` out where there is none, so that a scenario of before has the bytes of before."""
        return {name: value for name, value in inner(self).items() if name != "body" or value is not None}


class TrafficSpec(Spec):
    """Others on the road: simulated here, by SUMO, or read from a file."""

    source: Literal["built_in", "sumo", "fcd", "osi", "commonroad", "openscenario", "nuscenes"] = "built_in"
    file: str | None = Field(
        None,
        description="FCD, trace of OSI, CommonRoad, OpenSCENARIO, folder of nuScenes' tables or SUMO's configuration, "
        "relative to the scenario's file",
    )
    sequence: str | None = Field(None, min_length=1, description="scene of nuScenes' tables; default: the only one")
    density: Annotated[float, Unit("1/km")] = Field(
        10.0, ge=0.0, le=150.0, description="vehicles on a kilometre of lane [1/km]"
    )
    actors: int | None = Field(
        None,
        ge=1,
        le=1000,
        description="instead of a density: as many actors in all, for the whole drive, those nearest to the ego "
        "vehicle; beyond 20 m at the light level of geometry",
    )
    mix: dict[str, Annotated[float, Field(ge=0.0)]] | None = Field(
        None, description="shares of the models of vehicles; default: that of a town"
    )
    pedestrians: int = Field(0, ge=0, le=500)
    cyclists: int = Field(0, ge=0, le=200)
    parked: float = Field(0.0, ge=0.0, le=1.0, description="share of the parking places that are taken")
    open_ends: bool = Field(
        False,
        description="whether simulated traffic comes and goes at the ends of streets that the ego vehicle may see; "
        "else who does so between the first and the last frame is left out",
    )
    seed: int | None = Field(None, ge=0, description="default: the scenario's")

    @model_validator(mode="after")
    def _check(self) -> TrafficSpec:
        if self.file is None and self.source in ("fcd", "osi", "commonroad", "openscenario", "nuscenes"):
            raise ValueError(f"a `file` with source {self.source}")
        if self.file is not None and self.source == "built_in":
            raise ValueError("source sumo, fcd, osi, commonroad, openscenario or nuscenes with a `file`")
        if self.actors is not None and (self.source != "built_in" or "density" in self.model_fields_set):
            raise ValueError("source built_in and no `density` with `actors`")
        if self.sequence is not None and self.source != "nuscenes":
            raise ValueError("source nuscenes with a `sequence`")
        if self.mix is not None and not sum(self.mix.values()) > 0.0:
            raise ValueError("a `mix` with a share above 0")
        return self


class JitterSpec(Spec):
    """How far placements vary, each evenly between minus and plus."""

    along: Metres = Field(2.0, ge=0.0, le=50.0, description="along the lane or the heading [m]")
    lateral: Metres = Field(0.2, ge=0.0, le=5.0, description="to the side, kept within the lane [m]")
    yaw_deg: Degrees = Field(2.0, ge=0.0, le=180.0, description="of what stands [deg]")


class RandomizationSpec(Spec):
    """What is drawn at random from the scenario's seed; each switch leaves the draws of the others as they are."""

    colors: bool = Field(False, description="of actors and traffic, from palettes")
    materials: bool = Field(False, description="radio and lidar values of all materials within their uncertainty")
    placements: JitterSpec | None = Field(None, description="of the ego vehicle and the actors; `true`: the defaults")
    traffic: bool = Field(True, description="whether another seed gives another traffic")
    variant: VariantDraw = Field(None, description="place: one of so many variants, or of those listed")
    hour: HourDraw = Field(None, description="true solar time, between two hours")
    day_of_year: DayDraw | None = Field(None, description="between two, with `hour`")
    latitude_deg: Degrees = Field(50.0, ge=-90.0, le=90.0, description="of the place where it is the `hour` [deg]")
    north_deg: Degrees = Field(90.0, description="direction of north there, from +x towards +y [deg]")
    weather: WeatherDraws = Field(None, description="one of these")

    @model_validator(mode="after")
    def _check(self) -> RandomizationSpec:
        if self.day_of_year is not None and self.hour is None:
            raise ValueError("an `hour` with a `day_of_year`")
        return self

    @model_validator(mode="before")
    @classmethod
    def _switch(cls, data: object) -> object:
        if isinstance(data, dict) and isinstance(data.get("placements"), bool):
            return {**data, "placements": {} if data["placements"] else None}
        return data
