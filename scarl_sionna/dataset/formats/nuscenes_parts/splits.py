"""Names of nuScenes' own scenes by split: tools that know no other splits take ours under them.

References
----------
.. [1] nuscenes-devkit 1.2.0, ``nuscenes/utils/splits.py`` and ``nuscenes/can_bus/can_bus_api.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset.formats.source import FrameSource

NUMBERS: Mapping[str, str] = {
    "train": (
        "1-2 4-11 19-34 41-76 120-135 138-139 149-152 154-155 157-168 170-185 187-188 190-196 199-200 202-204 "
        "206-214 218-220 222 224-264 283-306 315-318 321 323-324 328 347-386 388-403 405-408 410-459 461-465 "
        "467-469 471-472 474-480 499-502 504-515 517-518 525-539 541-546 566 568 570-578 580 582-600 639-679 "
        "681 683-689 695-698 700-701 703-719 726-728 730-731 733-741 744 746-747 749-752 757-765 767-769 "
        "786-787 789-792 803-806 808-813 815-817 819-822 847-856 858 860-866 868-873 875-878 880 882-903 945 "
        "947 949 952-953 955-961 975-984 988-992 994-1025 1044-1058 1074-1102 1104-1110 "
    ),
    "val": (
        "3 12-18 35-36 38-39 92-110 221 268-278 329-332 344-346 519-524 552-565 625-627 629-630 632-638 "
        "770-771 775 777-778 780-784 794-800 802 904-917 919-931 962-963 966-969 971-972 1059-1073 "
    ),
    "test": (
        "77-91 111-119 140 142-148 265-266 279-282 307-314 333-343 481-498 547-551 601-604 606-624 827-831 "
        "833-842 844-846 932-933 935-943 1026-1043 "
    ),
    "mini_train": ("61 553 655 757 796 1077 1094 1100 "),
    "mini_val": ("103 916 "),
}
"""Numbers of the scenes of each split, in ranges."""
WITHOUT_CAN_BUS = "161-176 309-314"
"""Scenes of which the reader refuses CAN bus data; they are passed over."""
SPLITS_OF_VERSION: Mapping[str, Mapping[str, str]] = {
    "trainval": {"train": "train", "val": "val"},
    "test": {"test": "test"},
    "mini": {"train": "mini_train", "val": "mini_val"},
}
"""By how a version's name ends: the split of nuScenes that takes the scenes of one of ours."""
CUSTOM = "scarl_"
"""Before the name of a split of ours in ``splits.json``: the reader takes "train" for nuScenes' own list."""


def official_names(source: FrameSource, version: str) -> dict[str, str]:
    """Return for every scene the name of a scene of nuScenes that is in the same split.

    Parameters
    ----------
    source : FrameSource
    version : str
        Its end tells which splits there are: ``"v1.0-trainval"`` has train and val, ``"v1.0-test"`` test,
        ``"v1.0-mini"`` the small train and val.

    Raises
    ------
    ParameterRangeError
        If the version has no such split, or fewer names than there are scenes.
    """
    ending = version.rpartition("-")[2]
    if ending not in SPLITS_OF_VERSION:
        endings = ", ".join(f"-{name}" for name in SPLITS_OF_VERSION)
        raise ParameterRangeError("version", repr(version), f"a name that ends with {endings} for official names")
    splits = SPLITS_OF_VERSION[ending]
    left = {ours: official_scenes(theirs) for ours, theirs in splits.items()}
    names = {}
    for scene in source.scenes:
        split = source.split_of(scene.name)
        if split not in left:
            raise ParameterRangeError(
                "split",
                f"{split} of scene {scene.name}",
                f"{' or '.join(splits)} in {version}",
                "take some splits only (--split), or another version",
            )
        name = next(left[split], None)
        if name is None:
            raise ParameterRangeError(
                "scenes",
                f"more in split {split} than nuScenes has in {splits[split]}",
                f"{sum(1 for _ in official_scenes(splits[split]))} with official names",
                "take some scenes only, or the version v1.0-trainval",
            )
        names[scene.name] = name
    return names


def renamed(source: FrameSource, names: Mapping[str, str]) -> FrameSource:
    """Return a source whose scenes have other names."""
    scenes = [replace(scene, name=names[scene.name]) for scene in source.scenes]
    return FrameSource(source.rig, scenes, {s: [names[name] for name in own] for s, own in source.splits.items()})


def official_scenes(split: str) -> Iterator[str]:
    """Yield the names of the scenes of a split of nuScenes that may have a CAN bus, in order."""
    without = set(_expanded(WITHOUT_CAN_BUS))
    return (f"scene-{number:04d}" for number in _expanded(NUMBERS[split]) if number not in without)


def _expanded(ranges: str) -> Iterator[int]:
    for part in ranges.split():
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)
