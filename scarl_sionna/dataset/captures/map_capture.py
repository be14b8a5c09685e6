"""Maps that somebody computed of what a real radar recorded, frame after frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import overload

from scarl_sionna.core.prompt.describe import Described, Row, short
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.angle import RangeDopplerAngle


@dataclass(frozen=True, eq=False, repr=False)
class MapCapture(Described):
    """Maps over velocity, range and angle; each is read when it is asked for.

    ``capture[k]`` is the map of frame k as :class:`RangeDopplerAngle`, with axes in m, m/s and rad, rising. Where it
    has its channels, :func:`scarl_sionna.detect` takes it.

    Attributes
    ----------
    format : str
        Name of the format.
    radar : RadarSpec
        With the axes of the maps; see `notes` for what the dataset does not tell.
    names : tuple of str
        Of the frames' files, without what follows the point.
    notes : tuple of str
        What was taken for granted, or left out.
    read : callable
        From the number of a frame to its map.
    """

    format: str
    radar: RadarSpec
    names: tuple[str, ...]
    notes: tuple[str, ...]
    read: Callable[[int], RangeDopplerAngle]

    def _facts(self) -> Iterable[Row]:
        yield "format", self.format
        yield "num_frames", str(self.num_frames)
        yield "radar", short(self.radar)
        yield from (("note", note) for note in self.notes)

    @property
    def num_frames(self) -> int:
        """Number of maps."""
        return len(self.names)

    def __len__(self) -> int:
        return self.num_frames

    def __iter__(self) -> Iterator[RangeDopplerAngle]:
        return (self[index] for index in range(self.num_frames))

    @overload
    def __getitem__(self, index: int) -> RangeDopplerAngle: ...

    @overload
    def __getitem__(self, index: slice) -> list[RangeDopplerAngle]: ...

    def __getitem__(self, index: int | slice) -> RangeDopplerAngle | list[RangeDopplerAngle]:
        if isinstance(index, slice):
            return [self[position] for position in range(*index.indices(self.num_frames))]
        return self.read(range(self.num_frames)[index])
