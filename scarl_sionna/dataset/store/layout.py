"""What in a dataset's folder is ours: the one place that knows, asked by all that replaces or removes a file.

Ours is what a record names, what has a name that the format gives to something of the plan in *our* manifest, and a
file that says so itself (manifest, dataset card, log, contact sheet). All else is foreign: it stays byte for byte, and
where it stands in the way of a file of ours, an export stops before it begins.

::

    manifest.json  manifest.backup.json  README.md  export.log  contact_sheet.png
    arrays/zarr.json
    arrays/<scene>/[<group>/...]zarr.json
    arrays/<scene>/<array>/c/<shard>/0/...
    images/<scene>/<sensor>/<image>/<frame>.png
    shards/<scene>/<shard>.json  shards/<scene>/<shard>.frames.json  shards/<scene>/<shard>.zip
    .work/<scene>/<shard>/<frame>.pack  .work/<scene>/<shard>/part_<number>
    .locks/<name>.lock
    .partial_<name of a file of ours>_<process>
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from scarl_sionna.core.errors import ScarlError
from scarl_sionna.dataset import schema
from scarl_sionna.dataset.encoding import foreign_fields

from .atomic import PARTIAL
from .card import is_card
from .locks import LOCK_FOLDER
from .manifest import ARRAYS, BACKUP, FORMAT, IMAGES, MANIFEST, SHARDS, DatasetPlan

CARD = "README.md"
LOG_FILE = "export.log"
CONTACT_SHEET = "contact_sheet.png"
WORK_FOLDER = ".work"
METADATA = "zarr.json"
DATA_FOLDERS = (ARRAYS, IMAGES, SHARDS)
MARKED = (MANIFEST, BACKUP, CARD, LOG_FILE)
"""Files at the top of a dataset that tell by what stands in them whether they are ours."""
SHEET_MARK = "scarl-sionna contact sheet"
"""PNG text ``Software`` of a contact sheet."""

_FOLDERS = (*DATA_FOLDERS, WORK_FOLDER, LOCK_FOLDER)
_NUMBER = r"(\d{6,})"
_RECORD = re.compile(rf"{_NUMBER}(?:(?:\.frames)?\.json|\.zip)")
_PICTURE = re.compile(rf"(.+)/{_NUMBER}\.png")
_CHUNK = re.compile(r"(.+?)/c/(0|[1-9]\d*)((?:/0)*)")
_WORK = re.compile(rf"(?:{_NUMBER}\.pack|part_\d{{6,}}|{re.escape(PARTIAL)}{_NUMBER}\.(?:pack|json)_\d+)")
_TEMPORARY = re.compile(
    rf"(?:(?:{ARRAYS}|{SHARDS})/.+/)?{re.escape(PARTIAL)}"
    rf"(?:{re.escape(MANIFEST)}|{re.escape(BACKUP)}|{re.escape(CARD)}|{re.escape(METADATA)}|{_NUMBER}\.json)_\d+"
)
_SHEET_TEMPORARY = re.compile(rf"{re.escape(PARTIAL)}{re.escape(CONTACT_SHEET)}_\d+")
_LOG_LINE = re.compile(rb"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} \d+ [A-Z]+ ")
_HEAD = f'{{\n "format": "{FORMAT}"'.encode()


class Layout:
    """The names under ``arrays``, ``images`` and ``shards`` that are a dataset's own.

    Parameters
    ----------
    plan : DatasetPlan or None
        That of *our* manifest; None where it is lost.
    recorded : iterable of str
        Files that the records of finished shards name, and the records themselves.
    """

    def __init__(self, plan: DatasetPlan | None, recorded: Iterable[str] = ()) -> None:
        self._recorded = frozenset(recorded)
        self._frames = {} if plan is None else {scene.name: scene.num_frames for scene in plan.scenes}
        self._shard_frames = 1 if plan is None else plan.options.shard_frames
        self._is_packed = plan is not None and plan.options.layout == "packed"
        self._arrays, self._images = ({}, set()) if plan is None or self._is_packed else _fields(plan)
        self._groups = {
            "/".join(name.split("/")[:depth]) for name in self._arrays for depth in range(name.count("/") + 1)
        }

    def owns(self, name: str) -> bool:
        """Return whether a name, relative to the dataset, is one of its own."""
        if name in self._recorded:
            return True
        folder, _, rest = name.partition("/")
        if (folder, rest) == (ARRAYS, METADATA):
            return bool(self._frames) and not self._is_packed
        scene, _, rest = rest.partition("/")
        if scene not in self._frames:
            return False
        if folder == SHARDS:
            found = _RECORD.fullmatch(rest)
            is_of_layout = rest.count(".") == 1 if self._is_packed else rest.endswith(".json")
            return found is not None and is_of_layout and self._is_shard(scene, found[1])
        if folder == IMAGES:
            found = _PICTURE.fullmatch(rest)
            return found is not None and found[1] in self._images and self._is_frame(scene, found[2])
        if folder == ARRAYS:
            if rest == METADATA or rest.endswith(f"/{METADATA}"):
                return rest.rpartition("/")[0] in self._groups | self._arrays.keys()
            found = _CHUNK.fullmatch(rest)
            if found is None or len(found[3]) != 2 * self._arrays.get(found[1], -1):
                return False
            return self._is_shard(scene, f"{int(found[2]):06d}")
        return False

    def is_folder(self, name: str) -> bool:
        """Return whether a name is that of a folder in which a dataset keeps files, chunks' folders left out."""
        folder, _, rest = name.partition("/")
        scene, _, rest = rest.partition("/")
        if folder not in DATA_FOLDERS or (scene and scene not in self._frames):
            return False
        if not rest:
            return folder == SHARDS or not self._is_packed
        known = {ARRAYS: self._groups | self._arrays.keys(), IMAGES: self._images, SHARDS: set[str]()}[folder]
        return rest in known or any(item.startswith(f"{rest}/") for item in known)

    def shard_of(self, name: str) -> tuple[str, int] | None:
        """Return scene and shard of one of our files, None for one that belongs to no shard."""
        folder, _, rest = name.partition("/")
        scene, _, rest = rest.partition("/")
        if folder == SHARDS and (found := _RECORD.fullmatch(rest)):
            return scene, int(found[1])
        if folder == IMAGES and (found := _PICTURE.fullmatch(rest)):
            return scene, int(found[2]) // self._shard_frames
        if folder == ARRAYS and (found := _CHUNK.fullmatch(rest)):
            return scene, int(found[2])
        return None

    def _is_frame(self, scene: str, text: str) -> bool:
        return text == f"{int(text):06d}" and int(text) < self._frames[scene]

    def _is_shard(self, scene: str, text: str) -> bool:
        return text == f"{int(text):06d}" and int(text) * self._shard_frames < self._frames[scene]


def _fields(plan: DatasetPlan) -> tuple[dict[str, int], set[str]]:
    """Return the arrays that the sensors of a plan can give, and the folders of images.

    With the number of axes of each array after the frame.

    Names are relative to a scene.
    """
    tables = {"": schema.FRAME, "objects": schema.OBJECTS}
    for mount in plan.rig["sensors"]:
        tables[mount["name"]] = schema.mount_table(mount) or _foreign(mount["kind"])
    items = [(f"{group}/{item.name}".lstrip("/"), item) for group, table in tables.items() for item in table]
    if plan.options.radar_format == "complex64":
        items = [
            (name, schema.ADC_COMPLEX if item in schema.RADAR and item.name == "adc" else item) for name, item in items
        ]
    arrays = {name: len(item.axes) for name, item in items if item.storage == "array"}
    return arrays, {name for name, item in items if item.storage == "png"}


def _foreign(kind: str) -> tuple[schema.Field, ...]:
    try:
        return (schema.POSE, *(foreign_fields(kind) or ()))
    except ScarlError:  # the package of this kind is not installed: its files are those that records name
        return (schema.POSE,)


def is_temporary(name: str) -> bool:
    """Return whether a name is that of a file of ours that was on its way to its own name."""
    return _TEMPORARY.fullmatch(name) is not None or _SHEET_TEMPORARY.fullmatch(name) is not None


def is_lock(name: str) -> bool:
    """Return whether a file in the folder of the locks is one."""
    return re.fullmatch(r"[A-Za-z0-9_\-]+\.lock", name) is not None


def clear_temporaries(root: Path, sheet: bool) -> None:
    """Remove what killed processes were about to rename; the caller holds the lock of the manifest.

    `sheet`: also the contact sheet's, which no lock guards; only where no other export is let in.
    """
    for path in [*root.glob(f"{PARTIAL}*"), *root.glob(f"{SHARDS}/*/{PARTIAL}*")]:
        name = path.relative_to(root).as_posix()
        if _TEMPORARY.fullmatch(name) or (sheet and _SHEET_TEMPORARY.fullmatch(name)):
            remove_file(path)


def clear_work(folder: Path, keep: Iterable[str] = ()) -> None:
    """Remove our files from the folder of a shard that is in work, and the folder if it is empty then.

    Those of the names in `keep` stay.

    The caller holds the shard's lock.
    """
    if folder.is_symlink() or folder.parent.is_symlink():
        return
    kept = set(keep)
    for path in sorted(folder.glob("*")) if folder.is_dir() else ():
        if path.name not in kept and _WORK.fullmatch(path.name):
            remove_file(path)
    remove_empty(folder)


def remove_file(path: Path) -> bool:
    """Remove a file, a link, or an empty folder that took a file's place; return whether the name is free then."""
    try:
        if path.is_dir() and not path.is_symlink():
            return remove_empty(path)
        path.unlink(missing_ok=True)
    except NotADirectoryError:
        pass  # a file took the place of a folder above
    return True


def remove_empty(folder: Path) -> bool:
    """Remove a folder if nothing is in it; return whether it is gone."""
    try:
        folder.rmdir()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


def prune(root: Path, names: Iterable[str]) -> None:
    """Remove the folders of files that were removed, as far as nothing else is in them."""
    folders = {parent for name in names for parent in Path(name).parents if parent.name}
    for folder in sorted(folders, reverse=True):
        remove_empty(root / folder)


def is_manifest(path: Path, in_dataset: bool = False) -> bool:
    """Return whether a file is a manifest of ours, perhaps a damaged one.

    In a dataset that is what is no JSON at all.
    """
    data = _read(path)
    try:
        found = json.loads(data)
    except ValueError:
        return path.is_file() and (in_dataset or data.startswith(_HEAD))
    return isinstance(found, dict) and found.get("format") == FORMAT


def is_log(path: Path) -> bool:
    """Return whether a file is the log of an export."""
    data = _read(path, 64)
    return path.is_file() and (not data or _LOG_LINE.match(data) is not None)


def is_contact_sheet(path: Path) -> bool:
    """Return whether a file is a contact sheet that the demo drew."""
    return SHEET_MARK.encode() in _read(path, 1024)


def _read(path: Path, size: int = -1) -> bytes:
    if not path.is_file():  # a pipe would wait for ever
        return b""
    try:
        with open(path, "rb") as file:
            return file.read(size)
    except OSError:
        return b""


def foreign_marked(root: Path, in_dataset: bool, known_card: str | None = None) -> list[str]:
    """Return which of manifest, its copy, card and log are there and not ours.

    Parameters
    ----------
    root : Path
    in_dataset : bool
        Whether more than these files tells that it is a dataset.
    known_card : str, optional
        Text of a card that is ours without a mark.
    """

    def is_ours(path: Path) -> bool:
        if path.name == CARD:
            return is_card(path) or (known_card is not None and _read(path) == known_card.encode())
        return is_log(path) if path.name == LOG_FILE else is_manifest(path, in_dataset)

    paths = [root / name for name in MARKED]
    return [path.name for path in paths if os.path.lexists(path) and not is_ours(path)]


def blocked_folders(root: Path, scenes: Iterable[str]) -> list[str]:
    """Return which of a dataset's folders are files or links."""
    names = [*_FOLDERS, *(f"{folder}/{scene}" for scene in scenes for folder in (*DATA_FOLDERS, WORK_FOLDER))]
    return [
        name
        for name in names
        if os.path.lexists(root / name) and ((root / name).is_symlink() or not (root / name).is_dir())
    ]


def files_under(root: Path, folders: Iterable[str]) -> Iterator[tuple[str, bool]]:
    """Yield the name of every file and link in folders of a dataset, and of every folder; links are not followed.

    Sorted.

    The second value tells whether it is a folder.
    """
    for folder in folders:
        for place, below, files in os.walk(root / folder):
            below.sort()
            here = Path(place).relative_to(root).as_posix()
            for name in sorted([*files, *below]):
                is_folder = name in below and not os.path.islink(os.path.join(place, name))
                yield f"{here}/{name}", is_folder


def foreign_data(root: Path, new: Layout, there: Layout, scenes: Iterable[str]) -> list[str]:
    """Return what stands where a plan's files will be and is not ours.

    Parameters
    ----------
    root : Path
    new : Layout
        Of the plan.
    there : Layout
        Of the dataset that is there.
    scenes : iterable of str
        Scenes to look at.
    """
    found = []
    for name, is_folder in files_under(root, [f"{folder}/{scene}" for scene in scenes for folder in DATA_FOLDERS]):
        in_place_of_file = new.owns(name) and (is_folder or not there.owns(name))
        in_place_of_folder = not is_folder and new.is_folder(name)
        if in_place_of_file or in_place_of_folder:
            found.append(name)
    return found
