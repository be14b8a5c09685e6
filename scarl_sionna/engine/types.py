"""Types of what Dr.Jit and Mitsuba hand out.

Both are `Any` by intent: the classes belong to the variant that runs and are made when it is set, and the stubs of the
versions that are supported differ. The names say what is meant, where a class could be named at all.
"""

from __future__ import annotations

from typing import Any, TypeAlias

DeviceArray: TypeAlias = Any
"""A Dr.Jit array, mask or tensor of the variant that runs."""
MitsubaObject: TypeAlias = Any
"""A scene, sensor, integrator, ray or set of parameters of Mitsuba or Sionna RT."""
