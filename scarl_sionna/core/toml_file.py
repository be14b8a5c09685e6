"""Reading of TOML files with typed errors."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from .errors import SceneError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    SceneError
        If the file is missing, unreadable or not valid TOML.
    """
    try:
        with open(path, "rb") as stream:
            return tomllib.load(stream)
    except OSError as error:
        raise SceneError(f"cannot be read ({error.strerror})", path, "check the path and its permissions") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"not a valid TOML file ({error})", path, "correct the line named above") from error
