"""How a radar is simulated: method, tolerance, budget, noise, and the knobs of each channel solver."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    SkipValidation,
    model_serializer,
)

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.interferer import Interferer
from scarl_sionna.core.units import Metres

from .accuracy import Accuracy
from .auto import AutoSettings
from .mirrors import MirrorSettings
from .plan import ChannelPlan, of_mapping
from .raycast import RaycastSettings
from .sbr import SbrSettings
from .scanning import ScanningSettings
from .scatterers import ScattererSettings
from .sionna import SionnaSettings
from .warn import WarningLevels
from .weather_echoes import WeatherEchoSettings

Method = Literal["auto", "raycast", "sionna", "sbr", "scatterers", "hybrid"]
METHODS: tuple[str, ...] = get_args(Method)
PLAIN_METHODS: tuple[str, ...] = tuple(name for name in METHODS if name not in ("scatterers", "hybrid"))
"""Methods that need nothing but their name."""
QUALITIES = ("draft", "full")
"""Named levels of effort: ``"full"`` is the default of everything, ``"draft"`` is for a look at a scene."""


def _plan(value: object) -> ChannelPlan | None:
    if value is None or isinstance(value, ChannelPlan):
        return value
    if isinstance(value, Mapping):
        return of_mapping(ChannelPlan, value)
    raise InputTypeError("plan", value, "a ChannelPlan")


def _plan_data(value: ChannelPlan | None, info: SerializationInfo) -> dict[str, Any] | None:
    return None if value is None else value.to_dict("json" if info.mode == "json" else "python")


class RadarSettings(Spec):
    """How the raw data of a radar are computed: the same fields in Python, rig and scenario files and commands."""

    method: Method = Field(
        "auto",
        description="channel solver: 'auto' chooses for each object; 'raycast' is SCaRL's own; 'sionna' multipath; "
        "'sbr' physical optics; 'scatterers' objects with a model; 'hybrid' several by `plan`",
    )
    accuracy: Accuracy = Field(Accuracy(), description="tolerances, floor and budget")
    max_distance: Metres | None = Field(
        None,
        gt=0.0,
        description="half of the longest length of a path [m], whose last 0.25 m, or 5 % where that is less, "
        "fade out, by 6 dB in the middle; None: the unambiguous range of the radar",
    )
    instances: tuple[str | int, ...] | None = Field(
        None,
        description="names, ids or semantic classes of what gives paths by 'raycast' and 'sbr', the rest only hides; "
        "None: everything for 'raycast', actors and objects for 'sbr'",
    )
    noise: bool = Field(True, description="thermal noise of the receiver; False: the ideal sensor")
    chirps_per_block: int | None = Field(
        None,
        ge=1,
        description="paths are solved again in the middle of every block of so many chirps, for wheels and limbs; "
        "hits of 'raycast' stay those of the frame's start. None: once a frame",
    )
    interferers: tuple[Interferer, ...] = Field(
        (), description="other radars whose signals stand in the raw data; docs/interference.md"
    )
    num_band_frequencies: Literal[1, 3, 5, 7, 9, 11, 13, 15] = Field(
        1,
        description="paths are solved at so many frequencies of the band, and their transfer follows it, for thin "
        "layers above 1 GHz; docs/waveforms.md, wide bands",
    )
    cell_labels: bool = Field(True, description="make the ground truth of every range-Doppler cell with each frame")
    auto: AutoSettings = Field(AutoSettings(), description="rules by which 'auto' chooses for each object")
    mirrors: MirrorSettings = Field(
        MirrorSettings(), description="flat mirrors, over which 'hybrid' and 'auto' see objects again"
    )
    raycast: RaycastSettings = Field(
        RaycastSettings(), description="knobs of 'raycast', also for what 'auto' leaves to it"
    )
    sionna: SionnaSettings = Field(
        SionnaSettings(), description="knobs of 'sionna', also for the chains of mirrors of 'hybrid'"
    )
    sbr: SbrSettings = Field(SbrSettings(), description="knobs of 'sbr'; 'auto' sets its own from the tolerance")
    scatterers: ScattererSettings = Field(
        ScattererSettings(), description="models of objects, for 'scatterers' and 'auto'"
    )
    weather_echoes: WeatherEchoSettings = Field(
        WeatherEchoSettings(), description="points that stand for rain, snow and spray where the weather is not clear"
    )
    scanning: ScanningSettings = Field(
        ScanningSettings(), description="knobs of the turn of a scanning radar; others have no use for them"
    )
    warn_at: WarningLevels = Field(WarningLevels(), description="thresholds of warnings; they change no result")
    plan: Annotated[SkipValidation[ChannelPlan | None], BeforeValidator(_plan), PlainSerializer(_plan_data)] = Field(
        None, description="who computes what, for 'hybrid'"
    )

    _quiet = ("interferers", "num_band_frequencies", "scanning")

    @model_serializer(mode="wrap")
    def _without_none(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Leave out what files of the first versions do not have, where it is not used."""
        unused = {name: getattr(self, name) == type(self).model_fields[name].default for name in self._quiet}
        return {name: value for name, value in inner(self).items() if not unused.get(name, False)}

    @classmethod
    def preset(cls, quality: str) -> RadarSettings:
        """Return the settings of a quality.

        ``"full"`` states the default tolerance and numbers of rays and tubes, ``"draft"`` a quarter of the rays, their
        hits thinned by whole cells of resolution, 3.5 % of the tubes, and the tolerance of the coarsest level of
        `auto`, 6 dB, without its second look: so few tubes pay for no more (docs/radar_settings.md, draft). Nothing
        else is set.

        Raises
        ------
        UnknownNameError
            If there is no such quality.
        """
        if quality not in QUALITIES:
            raise UnknownNameError("quality", quality, QUALITIES)
        if quality == "draft":
            return cls(
                raycast=RaycastSettings(num_rays=250_000, cells_per_resolution=1.0),
                accuracy=Accuracy(tube_budget=35_000, channel_tolerance_db=6.0),
                auto=AutoSettings(look_share=0.0),
            )
        return cls(
            raycast=RaycastSettings(
                num_rays=RaycastSettings().num_rays, cells_per_resolution=RaycastSettings().cells_per_resolution
            ),
            accuracy=Accuracy(tube_budget=Accuracy().tube_budget, channel_tolerance_db=Accuracy().channel_tolerance_db),
            auto=AutoSettings(look_share=AutoSettings().look_share),
        )

    @classmethod
    def of(cls, method: str | None = None, **fields: object) -> RadarSettings:
        """Return settings from fields of any part, the short form of nested settings.

        ``RadarSettings.of("raycast", num_rays=1000)`` is ``RadarSettings(method="raycast",
        raycast=RaycastSettings(num_rays=1000))``.

        Parameters
        ----------
        method : str, optional
        **fields
            Fields of these settings, of the settings of `method`, or of one other part where no second part has such a
            field.

        Raises
        ------
        UnknownNameError
            If there is no such method or field.
        ParameterRangeError
            If several parts have such a field, or a value is not allowed.
        """
        if method is not None and method not in METHODS:
            raise UnknownNameError("channel solver", str(method), METHODS)
        return cls().changed(method, **fields)

    def changed(self, method: str | None = None, **fields: object) -> RadarSettings:
        """Return a copy with fields of any part changed; see :meth:`of`.

        Raises
        ------
        UnknownNameError, ParameterRangeError
            As of :meth:`of`.
        """
        if method is not None and method not in METHODS:
            raise UnknownNameError("channel solver", str(method), METHODS)
        chosen = method or self.method
        changes: dict[str, Any] = {} if method is None else {"method": method}
        for name, value in fields.items():
            part = self.part_of(name, chosen)
            if part is None:
                changes[name] = value
            else:
                changes[part] = changes.get(part, getattr(self, part)).with_(**{name: value})
        return self.with_(**changes) if changes else self

    def check_complete(self, sensor: str) -> None:
        """Raise if the method lacks what it needs, before the first frame does.

        Raises
        ------
        ParameterRangeError
            If `method` is ``"hybrid"`` without a `plan`, or ``"scatterers"`` without models.
        """
        if self.method == "hybrid" and self.plan is None:
            raise ParameterRangeError(
                f"method of '{sensor}'",
                "'hybrid' without a plan",
                f"{', '.join(PLAIN_METHODS)}, or hybrid with a plan",
                "'auto' makes a plan for each frame; one of your own is `radar.plan` of a scenario or rig file",
            )
        if self.method == "scatterers" and not self.scatterers.models:
            raise ParameterRangeError(
                f"method of '{sensor}'",
                "'scatterers' without models",
                f"{', '.join(PLAIN_METHODS)}, or scatterers with models",
                "name objects with their models in `radar.scatterers.models` of a scenario or rig file, "
                "or by --set 'radar.scatterers.models={car: tr38901:car}'",
            )

    @classmethod
    def part_of(cls, name: str, method: str) -> str | None:
        """Return which part has a field of a short form, None for these settings themselves.

        Raises
        ------
        UnknownNameError, ParameterRangeError
            As of :meth:`of`.
        """
        if name in cls.model_fields:
            return None
        parts = {part: kind for part, kind in _PARTS.items() if name in kind.model_fields}
        if method in parts:
            return method
        if len(parts) == 1:
            return next(iter(parts))
        if parts:
            raise ParameterRangeError(
                name,
                "a field of " + " and of ".join(f"`{part}`" for part in parts),
                "one field",
                f"write {next(iter(parts))}={_PARTS[next(iter(parts))].__name__}({name}=...)",
            )
        known = sorted({*cls.model_fields, *(field for kind in _PARTS.values() for field in kind.model_fields)})
        raise UnknownNameError(f"setting of method '{method}'", name, _relevant(cls, method, known, name))


def _relevant(cls: type[Spec], method: str, known: list[str], name: str) -> list[str]:
    """Return the names to list in an error: those of the method, and the closest of all."""
    own = set(cls.model_fields) | (set(_PARTS[method].model_fields) if method in _PARTS else set())
    return sorted(own | set(get_close_matches(name, known, n=1)))


_PARTS: Mapping[str, type[Spec]] = {
    "accuracy": Accuracy,
    "auto": AutoSettings,
    "mirrors": MirrorSettings,
    "raycast": RaycastSettings,
    "sionna": SionnaSettings,
    "sbr": SbrSettings,
    "scatterers": ScattererSettings,
    "scanning": ScanningSettings,
    "weather_echoes": WeatherEchoSettings,
    "warn_at": WarningLevels,
}
