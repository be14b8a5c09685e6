"""Renderings whose kernels are recorded once a scene: Mitsuba records the whole path tracer anew for each image.

The recording takes 0.3 to 0.4 s of one thread, a third of a small image. A recording knows arrays of the scene, sensor
and integrator as inputs; of a mesh, whose corners Mitsuba reads by their address on LLVM, it knows the address, so
:class:`~scarl_sionna.engine.twins.Twin` moves parts within their memory.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.types import DeviceArray, MitsubaObject

from .ray_table import RayTable


@dataclass(frozen=True, eq=False)
class Recording:
    """What makes one kind of image of a scene: a kernel, and the objects with which it was recorded."""

    sensor: MitsubaObject
    integrator: MitsubaObject
    render: Callable[[MitsubaObject, MitsubaObject, MitsubaObject, DeviceArray], MitsubaObject]


Recordings = dict[Hashable, Recording]
"""Kinds of images of one scene, by all that decides the kernel but arrays."""


def may_record(mi: ModuleType, scene: MitsubaObject) -> bool:
    """Return whether images of a scene may be recorded: on the processor, and lit from outside of the scene only.

    What Mitsuba keeps of surfaces that shine is not among the inputs of a recording.
    """
    surface = mi.EmitterFlags.Surface
    return mi.variant().startswith("llvm") and not any(mi.has_flag(e.flags(), surface) for e in scene.emitters())


def recording(mi: ModuleType, sensor: MitsubaObject, integrator: MitsubaObject, samples: int) -> Recording:
    """Return a new recording of images with some samples a pixel; it records when it renders first, and next."""
    import drjit as dr

    def box(scene: MitsubaObject, *_: object) -> tuple[float, ...]:
        """Of the scene, of which Mitsuba's sky keeps numbers: where it changes, another kernel is recorded."""
        bounds = scene.bbox()
        return tuple(float(value) for corner in (bounds.min, bounds.max) for value in corner)

    @dr.freeze(state_fn=box, warn_after=1 << 30)
    def render(
        scene: MitsubaObject, sensor: MitsubaObject, integrator: MitsubaObject, seed: DeviceArray
    ) -> MitsubaObject:
        return mi.render(scene, sensor=sensor, integrator=integrator, seed=seed, spp=samples)

    return Recording(sensor, integrator, render)


def rendered(
    mi: ModuleType, scene: MitsubaObject, recorded: Recording, table: RayTable, seed: int
) -> npt.NDArray[np.float32]:
    """Return the image of ``mi.render`` through a table of rays, to the last bit; inside ``variant.optical()``."""
    import drjit as dr

    recorded.sensor.place(table)
    return np.array(recorded.render(scene, recorded.sensor, recorded.integrator, dr.opaque(mi.UInt32, seed)))
