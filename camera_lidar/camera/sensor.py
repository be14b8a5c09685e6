"""The camera as a sensor of the rig."""

from __future__ import annotations

from typing import Any

import numpy as np

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import ImageFrame
from scarl_sionna.world.placement import check_placement

from .labels import render_labels
from .render import render_rgb


class Camera:
    """An ideal pinhole camera with a global shutter of no duration.

    Parameters
    ----------
    spec : CameraSpec
    """

    def __init__(self, spec: CameraSpec) -> None:
        self.spec = spec

    def observe(
        self, state: Any, world_from_sensor: Pose, sensor_twist: Twist, seed_generator: np.random.Generator
    ) -> ImageFrame:
        """Return the images named in ``spec.images`` at the state's time; the others stay None and cost nothing.

        Parameters
        ----------
        state : scarl_sionna.world.WorldState
        world_from_sensor : Pose
            Sensor frame (x forward = optical axis, y left, z up).
        sensor_twist : Twist
            Not used: the shutter is open for no time, so nothing blurs.
        seed_generator : numpy.random.Generator
            Seeds the samples of the RGB image; the label images are not random.

        Raises
        ------
        PlacementError
            If the camera is inside a closed mesh.
        """
        check_placement(state, world_from_sensor.position, "camera")
        wanted = set(self.spec.images)
        rgb = render_rgb(state, self.spec, world_from_sensor, seed_generator) if "rgb" in wanted else None
        labels = render_labels(state, self.spec, world_from_sensor) if wanted - {"rgb"} else None
        return ImageFrame(
            spec=self.spec,
            world_from_sensor=world_from_sensor,
            rgb=rgb,
            depth=labels.depth if labels and "depth" in wanted else None,
            semantic=labels.semantic if labels and "semantic" in wanted else None,
            instance=labels.instance if labels and "instance" in wanted else None,
        )
