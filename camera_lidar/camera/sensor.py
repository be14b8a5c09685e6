"""The camera as a sensor of the rig."""

from __future__ import annotations

from typing import Any

import numpy as np

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect_generator
from scarl_sionna.core.results import ImageFrame
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.rays.placement import check_placement
from scarl_sionna.engine.threads import few_threads
from scarl_sionna.engine.world import WorldState

from .labels import LABEL_NAMES, render_labels
from .render import render_rgb


class Camera:
    """A camera with a global or rolling shutter, whose RGB and label images share one projection.

    Parameters
    ----------
    spec : CameraSpec
    """

    def __init__(self, spec: CameraSpec) -> None:
        self.spec = spec

    @few_threads()
    def observe(self, state: WorldState, mount: Mount | Pose, rng: np.random.Generator) -> ImageFrame:
        """Return the images named in ``spec.images`` at the state's time; the others stay None and cost nothing.

        Parameters
        ----------
        state : WorldState
        mount : Mount or Pose
            Sensor frame (x forward = optical axis, y left, z up); its velocity is for motion blur, a rolling shutter
            and optical flow.
        rng : numpy.random.Generator
            Seeds the samples and the noise of the RGB image; the label images are not random.

        Raises
        ------
        InputTypeError
            If `rng` is no generator, where the RGB image is asked for.
        PlacementError
            If the camera is inside a closed mesh.
        EngineError
            If a denoised image is asked for and Open Image Denoise is missing.
        """
        place = state.as_mount(mount)
        check_placement(state, place.pose.position, "camera")
        wanted = set(self.spec.images)
        images: dict[str, Any] = {}
        if "rgb" in wanted:
            expect_generator(rng)
            images["rgb"] = render_rgb(state, self.spec, place.pose, rng, place.twist)
        if chosen := [name for name in LABEL_NAMES if name in wanted]:
            labels = render_labels(state, self.spec, place.pose, place.twist, chosen)
            images |= {name: getattr(labels, name) for name in chosen}
        return ImageFrame(spec=self.spec, world_from_sensor=place.pose, **images)
