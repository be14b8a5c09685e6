"""The paths of the raycast solver in plain NumPy: one array operation after the other, materials one by one.

It shares with the solver what a ray grid, a cast, a material's reflectance and a class's RCS are, and nothing of
the kernel.
"""

from __future__ import annotations

import numpy as np

from scarl_sionna.radar.channel.raycast.class_rcs import class_crossed, class_reflectivity, rough_ground
from scarl_sionna.radar.channel.raycast.grid import RayGrid
from scarl_sionna.scene.materials.fresnel import power_reflectance, te_fraction_of_h
from scarl_sionna.scene.materials.rough import scattered_part
from scarl_sionna.signal.link import radar_gain


def columns(state, radar, mount, knobs, reach):
    """Return point, velocity, length rate, magnitudes of VV, HH and VH, instance and number of every hit's ray."""
    fov = np.radians(radar.azimuth_fov_deg), np.radians(radar.elevation_fov_deg)
    grid = RayGrid.over(*fov, knobs.num_rays, kind=knobs.grid)
    local = grid.directions(0, grid.num_rays)
    world = mount.pose.rotate(local)
    hits, parts, frequency = state.cast(mount.pose.position, world, reach), state.world.parts, radar.center_frequency
    te, tm = np.zeros(hits.num_hits), np.zeros(hits.num_hits)
    for part in np.unique(hits.part):
        rows = np.flatnonzero(hits.part == part)
        material = state.world.materials[parts.material[part]]
        te[rows], tm[rows] = power_reflectance(material, frequency, hits.cos_incidence[rows])
    up = hits.normal @ mount.pose.rotation[:, 2]
    horizontal_te = te_fraction_of_h(local[hits.ray, 2], hits.cos_incidence, up)
    vv, hh = te + horizontal_te * (tm - te), tm + horizontal_te * (te - tm)
    table, cosine = rough_ground(state.world, frequency, knobs)[hits.part], hits.cos_incidence
    blade = np.nan_to_num(table[:, 2])  # of a deep layer: w H^2 / (8 mu)
    spread = ((1.0 + 2.0 * cosine) / (1.0 + 2.0 * cosine * np.sqrt(1.0 - blade))) ** 2
    rough = table[:, :2] * np.where(blade > 0.0, blade * spread / 8.0, cosine)[:, None]
    for part in np.unique(hits.part):
        rows = np.flatnonzero(hits.part == part)
        rough[rows] *= scattered_part(state.world.materials[parts.material[part]], frequency, cosine[rows])[:, None]
    by_class = (vv + hh) / 2.0 * class_crossed(knobs.class_rcs)[parts.semantic[hits.part]]
    by_class *= not radar.array.is_of_one_polarization
    ground = ~np.isnan(rough[:, 0])
    vv[ground] = hh[ground] = rough[ground, 0]
    footprint = 4.34e-4 if knobs.rcs_model == "per_hit" else grid.solid_angle * hits.distance**2
    gamma = class_reflectivity(knobs.class_rcs)[parts.semantic[hits.part]]
    power = radar_gain(radar.wavelength, hits.distance) * np.where(ground, 1.0, gamma) * footprint
    velocity = hits.velocity - mount.twist.linear
    found = {
        "point": hits.point,
        "velocity": velocity,
        "length_rate": 2.0 * np.einsum("ij,ij->i", velocity, world[hits.ray]),
        "vv": np.sqrt(power * vv),
        "hh": np.sqrt(power * hh),
        "vh": np.sqrt(power * np.where(ground, rough[:, 1], by_class)),
        "instance": parts.instance[hits.part],
        "ray": hits.ray,
    }
    gives = np.flatnonzero((power > 0.0) & (vv + hh > 0.0) & (hits.distance < reach))
    return {name: column[gives] for name, column in found.items()}
