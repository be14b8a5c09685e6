"""Long arrays in blocks that stay in the cache, or within the memory that is meant for them."""

from __future__ import annotations

from collections.abc import Iterator


def in_blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of a bounded size."""
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))
