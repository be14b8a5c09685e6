"""Optional packages: imported where they are used, with the remedy in the error where they are missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from .errors import MissingPackageError


def require(module: str, extra: str) -> ModuleType:
    """Return a module of an optional package.

    Parameters
    ----------
    module : str
        For instance ``"h5py"``.
    extra : str
        Extra of scarl-sionna that installs it, for instance ``"hdf5"``.

    Raises
    ------
    MissingPackageError
        If the package is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise  # the package is there, but something that it needs is not
        raise MissingPackageError(module.partition(".")[0], extra) from error
