"""Unpack scenes and actor models and print where they lie.

``python -m scenes_xml [NAME ...]``, without names all of them.

Their XML opens in Mitsuba as it is. On a machine where later processes cannot write, call it once with
``SCARL_CACHE_DIR`` set.
"""

from __future__ import annotations

import sys

from . import actor_names, actor_path, scene_names, scene_path


def main(names: list[str]) -> int:
    """Print a path a line; return the exit status."""
    known = {**dict.fromkeys(scene_names(), scene_path), **dict.fromkeys(actor_names(), actor_path)}
    if unknown := sorted(set(names) - set(known)):
        print(f"no scene or actor model {', '.join(unknown)}; choose from {', '.join(known)}", file=sys.stderr)
        return 2
    try:
        for name in names or known:
            print(known[name](name))
    except OSError as error:
        print(error.strerror or error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
