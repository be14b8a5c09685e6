"""What shadows that tubes have not resolved may do to echoes: gaps between palings, narrower than the probes stand."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.warn import WarningLevels
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.band_mean import NUM_FREQUENCIES, heard, heard_power, mean_over_band
from scarl_sionna.radar.link import path_unit
from scarl_sionna.radar.optics.tubes.checks import Wrong

from .rows import Columns

MOST_DB = 99.0
"""Largest error that is told [dB]."""


def shadows_db(
    wrong: Mapping[int, Wrong],
    columns: Columns,
    radar: RadarSpec,
    floor_db: float | None = None,
    is_monostatic: bool = True,
) -> dict[int, float]:
    r"""Return by how much the echo of instances may be off for what is not lit as their tubes are [dB].

    Parameters
    ----------
    wrong : mapping
        By instance, see :meth:`.Lit.wrong`.
    columns : dict
        Of all rows of a solve.
    radar : RadarSpec
    floor_db : float, optional
        Instances whose echo is below it even with that error are left out, [dB] over the noise of a cell. Of one of
        which the tubes light nothing, what is lit is taken for a flash.
    is_monostatic : bool
        Whether the radar receives itself.

    Notes
    -----
    Of a flash the share q that is wrong is one of the field. Where the fields of patches cancel, n wrong pieces of
    random phases are more of what is left, with the fields a that the antennas hear:

    .. math:: 20 \log_{10}\left(1 + q \max\left(1, \frac{\sum |a|}{\sqrt{n}\, |\sum a|}\right)\right)
    """
    found, first = {}, columns["instance"][:, 0]
    least = 0.0 if floor_db is None else float(np.sqrt(10.0 ** (floor_db / 10.0) / path_unit(radar)))
    for number, (share, points, missed) in wrong.items():
        rows = np.flatnonzero(first == number)
        a, length, place = columns["a"][rows], columns["length"][rows], np.zeros(len(rows), dtype=np.int64)
        powers = [
            mean_over_band(field, length, place, radar, NUM_FREQUENCIES).sum()
            for field in heard(a, radar, is_monostatic)
        ]
        echo = float(np.sqrt(np.sum(powers)))
        alone = np.sqrt(heard_power(a[columns["depth"][rows] == 1], radar, is_monostatic))
        cancelled = float(alone.sum()) / max(echo, 1e-300) if len(rows) else 1.0
        error = 20.0 * np.log10(1.0 + share * max(1.0, cancelled / np.sqrt(points)))
        most = echo * 10.0 ** (error / 20.0) if np.isfinite(share) else echo + missed / (4.0 * np.pi)
        if most >= least:
            found[number] = min(round(float(error), 2), MOST_DB)
    return found


def warn_of_shadows(errors: Mapping[str, float], levels: WarningLevels) -> None:
    """Warn of instances, by name, whose echo may be off by more than `levels.shadow_error` for their shadows [dB]."""
    some = {name: error for name, error in errors.items() if error > levels.shadow_error}
    if some:
        worst = max(some, key=lambda name: some[name])
        warnings.warn(
            f"shadows on {len(some)} instance(s) are finer than the rays that probe tubes, such as on '{worst}', whose "
            f"echo may be off by {some[worst]:.2g} dB for it: smaller ray_share or max_phase; "
            "diagnostics['shadows_db'] has each",
            ScarlWarning,
            stacklevel=4,
        )
