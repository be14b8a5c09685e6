"""Images whose kernel is recorded once for a scene, and then only run: with other rays, other haze, moved actors.

Mitsuba traces the light paths' loop anew for each image, BSDF by BSDF and mesh by mesh, and writes the kernel that
follows, only to find it in the cache: 0.1 s on a highway, 0.25 s in a street, on one thread, whatever the samples.
``dr.freeze`` leaves that out from the third image of a kind on. All bytes are those without it.
"""

from __future__ import annotations

import gc
import signal
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray, MitsubaObject

from . import ray_table
from .ray_table import RayTable, ray_numbers, ray_table_sensor

MOST_KINDS = 6
"""Kinds of images of a scene that are recorded; others are made as if there were no recordings."""


@dataclass(frozen=True, eq=False)
class LightTracer:
    """How light is traced.

    Attributes
    ----------
    make : callable
        Returns the integrator.
    kind : hashable or None
        All that decides the integrator's code; None: it is not recorded.
    numbers : tuple of Dr.Jit arrays
        What the integrator's `take` gets anew for each image, where it takes something.
    """

    make: Callable[[], MitsubaObject]
    kind: Hashable = None
    numbers: tuple[DeviceArray, ...] = ()


class _Recorded:
    """An integrator, a sensor and what is recorded of them; nothing of it holds the scene."""

    def __init__(self, mi: ModuleType, tracer: LightTracer, table: RayTable, samples: int) -> None:
        import drjit as dr

        self._mi = mi
        integrator, sensor = tracer.make(), ray_table_sensor(mi, table, samples)

        def render(
            scene: MitsubaObject, numbers: tuple[DeviceArray, ...], rays: tuple[DeviceArray, ...], seed: DeviceArray
        ) -> DeviceArray:
            if numbers:
                integrator.take(*numbers)
            sensor.take(*rays)
            image = integrator.render(scene, sensor, seed=seed, spp=samples)
            sensor.sampler().seed(0, 1)  # else where it stands after all paths is a result, too, and is computed
            return image

        self._render = dr.freeze(render, warn_after=1 << 16)

    def __call__(self, scene: MitsubaObject, tracer: LightTracer, table: RayTable, seed: int) -> DeviceArray:
        with signals_wait():
            return self._render(scene, tracer.numbers, ray_numbers(self._mi, table), self._mi.UInt32(seed))


@contextmanager
def signals_wait() -> Iterator[None]:
    """Return a context manager in which handlers of signals that Python runs wait for its end.

    An exception out of the middle of a recording, as Ctrl-C is one, ends the process.
    """
    handlers: dict[int, Any] = {}
    caught: list[int] = []
    if threading.current_thread() is threading.main_thread():  # no other one runs handlers
        handlers = {number: signal.getsignal(number) for number in signal.valid_signals()}
        handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, _: caught.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in caught:
            handlers[number](number, None)


class HasScene(Protocol):
    """A twin: it has one scene as long as it lives."""

    mi_scene: MitsubaObject


_RECORDED: WeakKeyDictionary[HasScene, OrderedDict[Hashable, _Recorded | None]] = WeakKeyDictionary()
"""By the twin, so that they go with it: a recording is valid for one scene."""
_lock = threading.Lock()


def launch(
    mi: ModuleType, twin: HasScene, tracer: LightTracer, table: RayTable, samples: int, seed: int
) -> npt.NDArray[np.float32]:
    """Render an image; inside ``variant.optical()``.

    Parameters
    ----------
    mi : module
    twin : HasScene
        In the state that the image is to show.
    tracer : LightTracer
    table : RayTable
    samples : int
        A pixel.
    seed : int

    Returns
    -------
    ndarray of float32, shape (height, width, channels)
    """
    import drjit as dr

    with many_threads():
        # sums have a copy for each thread, the number of which is recorded
        key = (mi.variant(), tracer.kind, table.seen.shape, samples, ray_table.SAMPLER, dr.thread_count())
        with _turn() as free:
            recorded = _recorded(mi, twin, tracer, table, key) if free and tracer.kind is not None else None
            if recorded is not None:
                return np.array(recorded(twin.mi_scene, tracer, table, seed))
        sensor = ray_table_sensor(mi, table, samples)
        return np.array(mi.render(twin.mi_scene, sensor=sensor, integrator=tracer.make(), seed=seed, spp=samples))


@contextmanager
def _turn() -> Iterator[bool]:
    """Return a context manager that yields whether nobody else records or replays, with the garbage left alone.

    What Python frees while a kernel is recorded may be of the engine's.
    """
    free = _lock.acquire(blocking=False)
    collects = gc.isenabled()
    try:
        if free:
            gc.disable()
        yield free
    finally:
        if free:
            if collects:
                gc.enable()
            _lock.release()


def _recorded(
    mi: ModuleType, twin: HasScene, tracer: LightTracer, table: RayTable, key: tuple[Any, ...]
) -> _Recorded | None:
    """Return what is recorded, or None for the first image of a kind: it may be the only one."""
    if not mi.variant().startswith("llvm"):
        return None
    kinds = _RECORDED.setdefault(twin, OrderedDict())
    if key not in kinds:
        kinds[key] = None
        while len(kinds) > MOST_KINDS:
            kinds.popitem(last=False)
        return None
    kinds.move_to_end(key)
    found = kinds[key]
    if found is None:
        found = kinds[key] = _Recorded(mi, tracer, table, key[3])
    return found
