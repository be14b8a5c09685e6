"""Which of the two senses of a bounce stands for both."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.face_planes import face_table
from scarl_sionna.radar.channel.sbr.senses import Kind, flat_widths, kinds_of
from tests.scenes import Thing, box, plane, write_scene


def test_the_width_of_a_flat_region_is_its_narrow_side(tmp_path) -> None:
    """A strip of 8 x 0.5 m, 0.2 % off by its diagonal; a cube of 1 m, whose faces are 1 m over their diagonal."""
    things = [Thing("strip", plane(8.0, 0.5)), Thing("cube", box((1.0, 1.0, 1.0), (0, 0, 3)))]
    table = face_table(load_scene(write_scene(tmp_path, things)).at(0.0))
    found = flat_widths(table.triangles.corners, table.plane)
    assert found[table.part == 0] == pytest.approx(0.5, rel=3e-3)
    assert found[table.part == 1] == pytest.approx(np.sqrt(0.5), rel=1e-9)


def test_clearly_wider_first_faces_of_another_body_serve_both_senses() -> None:
    wide, narrow = np.array([3.0, 0.1, 3.0, 3.0, 0.19]), np.array([0.1, 3.0, 2.0, 0.1, 0.1])
    instance = np.array([(1, 2), (2, 1), (1, 2), (1, 1), (1, 2)])
    expected = [Kind.REVERSED, Kind.LEFT_OUT, Kind.TRACED, Kind.TRACED, Kind.TRACED]
    assert kinds_of(wide, narrow, instance).tolist() == expected
