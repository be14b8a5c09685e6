"""Constructors show their fields, units are data, and specifications show themselves in a few lines."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import get_args

import pytest

import scarl_sionna as ss
from scarl_sionna.core.prompt.refusals import unit_of
from scarl_sionna.core.spec import Spec

PUBLIC = [getattr(ss, name) for name in ss.__all__ if isinstance(getattr(ss, name), type)]


def _with_parts(model: type[Spec]) -> Iterator[type[Spec]]:
    """Yield a specification and all that stand in its fields."""
    yield model
    waiting = [info.annotation for info in model.model_fields.values()]
    while waiting:
        annotation = waiting.pop()
        if isinstance(annotation, type) and issubclass(annotation, Spec):
            yield from _with_parts(annotation)
        waiting += get_args(annotation)


SPECS = sorted(
    {part for kind in PUBLIC if issubclass(kind, Spec) for part in _with_parts(kind)}, key=lambda kind: kind.__name__
)


def test_there_are_specifications_to_test() -> None:
    assert {"RadarSpec", "CameraSpec", "LidarSpec", "RasterScan", "Weather"} <= {kind.__name__ for kind in SPECS}


@pytest.mark.parametrize("kind", SPECS, ids=lambda kind: kind.__name__)
def test_a_constructor_shows_its_fields(kind: type[Spec]) -> None:
    parameters = inspect.signature(kind).parameters
    assert list(parameters) == list(kind.model_fields)
    for name, info in kind.model_fields.items():
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
        required = parameters[name].default is inspect.Parameter.empty
        assert required == info.is_required()
        if not required:
            assert parameters[name].default == info.get_default(call_default_factory=True)
        assert "Annotated" not in inspect.formatannotation(parameters[name].annotation)


@pytest.mark.parametrize("kind", [kind for kind in PUBLIC if is_dataclass(kind)], ids=lambda kind: kind.__name__)
def test_a_dataclass_shows_its_fields(kind: type) -> None:
    assert list(inspect.signature(kind).parameters) == [item.name for item in fields(kind) if item.init]


@pytest.mark.parametrize("kind", SPECS, ids=lambda kind: kind.__name__)
def test_the_unit_of_a_description_is_that_of_the_type(kind: type[Spec]) -> None:
    for name, info in kind.model_fields.items():
        written = [unit.removesuffix(", world") for unit in re.findall(r"\[([^\[\]]+)\]", info.description or "")]
        if len(written) == 1 and info.annotation is not str:
            assert unit_of(info) == written[0], f"{kind.__name__}.{name}: give its type the unit, see core/units.py"


def test_a_signature_reads_like_a_constructor() -> None:
    text = str(inspect.signature(ss.Weather))
    assert text.startswith("(*, rain_rate: float = 0.0, ") and "visibility: float | None = None" in text


@pytest.mark.parametrize("kind", SPECS, ids=lambda kind: kind.__name__)
def test_a_signature_is_one_line(kind: type[Spec]) -> None:
    assert "\n" not in str(inspect.signature(kind))


def test_a_default_in_a_signature_shows_as_it_is_written() -> None:
    kinds = (
        "waveform.Fmcw",
        *(f"waveforms.{name}" for name in ("kinds.SteppedFmcw", "phase_coded.PcFmcw", "coded.Ofdm", "coded.Pmcw")),
    )
    union = " | ".join(f"scarl_sionna.core.specs.radar.{name}" for name in kinds)
    assert f"waveform: {union} = Fmcw(), " in str(inspect.signature(ss.RadarSpec))


def test_specifications_show_units_and_stay_short() -> None:
    assert repr(ss.Pinhole()) == "Pinhole(model='pinhole')"
    assert repr(ss.Pinhole()) == str(ss.Pinhole())
    lines = repr(ss.RadarSpec()).splitlines()
    assert lines[0] == "RadarSpec" and len(lines) <= 20 and max(map(len, lines)) <= 110
    assert "range_resolution" in lines[1] and "0.499654 m" in lines[1]  # c / (2 * 300 MHz)
    assert any(line.split() == ["start_frequency", "77", "GHz"] for line in lines)
    assert any(line.endswith("tx_power_dbm 12 dBm, noise_figure_db 12 dB, source_temperature 290 K") for line in lines)
    every = repr(ss.RadarSpec().with_(sampling_frequency=20e6)).splitlines()  # a field more than the default shows
    assert len(every) == 20 and every[-1].split() == ["elevation_fov_deg", "30", "deg"]
