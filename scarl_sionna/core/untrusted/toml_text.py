"""Reading of TOML files with typed errors."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import InputFileError, SceneError

from .files import MEGABYTE, read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_MOST_BYTES = 16 * MEGABYTE


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    SceneError
        If the file is missing, unreadable or not valid TOML.
    """
    try:
        return tomllib.loads(read_text(path, _MOST_BYTES))
    except InputFileError as error:
        raise SceneError(str(error.strerror), path) from error
    except OSError as error:
        raise SceneError(f"cannot be read ({error.strerror})", path, "check the path and its permissions") from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, an integer of thousands of digits, deep nesting
        raise SceneError(f"not a valid TOML file ({error})", path, "correct the line named above") from error
