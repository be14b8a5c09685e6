"""Radio materials at the carrier of a radio link, which may lie far from the radars' band.

The main table holds 76-81 GHz; what its materials have elsewhere stands in ``other_bands.toml`` beside this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from scarl_sionna.core.errors import MaterialRangeError
from scarl_sionna.core.spec import FieldValue
from scarl_sionna.core.untrusted.toml_text import read_toml

from .table import RadioMaterial, builtin_materials

OTHER_BANDS = Path(__file__).with_name("other_bands.toml")


@cache
def _other_bands() -> Mapping[str, tuple[Mapping[str, FieldValue], ...]]:
    """Return the bands of each material: fields of `RadioMaterial`."""
    return {
        name: tuple({**band, "frequency_range": tuple(band["frequency_range"])} for band in bands)
        for name, bands in read_toml(OTHER_BANDS).items()
    }


def bands_of(material: RadioMaterial) -> tuple[RadioMaterial, ...]:
    """Return a material in every band that has data: its own entry first.

    Other bands go by the material's name; those of a wet one by what is under the water.
    """
    others = _other_bands().get(material.name.partition(",")[0], ())
    return material, *(material.with_(**band) for band in others)


def at_carrier(material: RadioMaterial, frequency: float) -> RadioMaterial:
    """Return a material with values that are valid at a frequency: its own entry's, or those of another band.

    Parameters
    ----------
    material : RadioMaterial
        Of any table.
    frequency : float
        [Hz].

    Raises
    ------
    MaterialRangeError
        If neither has data there.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3, Table 3; for the rest the source of each band.
    """
    bands = bands_of(material)
    for band in bands:
        if band.covers(frequency):
            return band
    known = [name for name, other in builtin_materials().items() if any(b.covers(frequency) for b in bands_of(other))]
    nearest = min(bands, key=lambda band: abs(_nearest(band, frequency) - frequency))
    raise MaterialRangeError(material.name, frequency, nearest.frequency_range, known)


def nearest_to_carrier(material: RadioMaterial, frequency: float) -> tuple[RadioMaterial, float]:
    """Return the material of :func:`at_carrier`, or that of its nearest valid frequency, and that frequency [Hz].

    What is carried over from there to the frequency is the complex permittivity: it stays as it is.
    """
    try:
        return at_carrier(material, frequency), frequency
    except MaterialRangeError:
        own = min(bands_of(material), key=lambda band: abs(_nearest(band, frequency) - frequency))
    near = _nearest(own, frequency)
    return own.with_(
        relative_permittivity=own.permittivity_at(near),
        conductivity=own.conductivity_at(near),
        reference_frequency=near,
        permittivity_exponent=0.0,
        conductivity_exponent=1.0,
        frequency_range=(min(near, frequency), max(near, frequency)),
    ), near


def _nearest(material: RadioMaterial, frequency: float) -> float:
    """Return the frequency nearest to another at which an entry is valid [Hz]."""
    low, high = material.frequency_range
    return min(max(frequency, low), high)
