"""Speed and error of ss.rcs: a sphere of 9,000 triangles, knobs, a car, full wave.

Run: ``python benchmarks/rcs.py [sphere] [knobs] [car] [slope] [fullwave]``. By default the first two; each takes at
most three minutes on two quiet cores. `car` and `slope` draw into docs/figures/.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.harness import machine, measure, peak_memory
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.optics.body.mesh import Body
from scarl_sionna.radar.rcs import actor_parts, load_body, rcs, scattering_matrix

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
FREQUENCY = 76.5e9
THETA, PHI = 1.0, 0.5


def dbsm(sigma) -> float:
    return float(10 * np.log10(sigma))


def sphere(radius: float) -> trimesh.Trimesh:
    """Return a sphere of 9,024 triangles."""
    return trimesh.creation.uv_sphere(radius=radius, count=[48, 96])


def with_rays(body: Body) -> Body:
    """Return the body without the knowledge that nothing stands in front of its faces: every face is probed by rays."""
    return replace(body, free=np.zeros_like(body.free))


def bench_sphere() -> None:
    print("\nSphere of 9,024 triangles at 76.5 GHz, one ray per wavelength, one angle (bar: 3 CPU seconds)")
    for radius in (0.5, 1.0):
        mesh = sphere(radius)
        body = load_body(mesh)
        for name, case in (("faces with nothing in front need no rays", body), ("every face probed", with_rays(body))):
            timing = measure(lambda case=case: rcs(case, FREQUENCY, THETA, PHI), repeats=3)
            level = dbsm(rcs(case, FREQUENCY, THETA, PHI))
            print(f"  radius {radius} m, {name:40s} {timing}   {level:8.4f} dBsm")
        print(f"  radius {radius} m, {'mesh made ready (once)':40s} {measure(lambda mesh=mesh: load_body(mesh), 3)}")


def bench_knobs() -> None:
    print("\nKnobs: error of the scattering matrix relative to its largest entry, CPU seconds an angle")
    wavelength = SPEED_OF_LIGHT / 77e9
    corner = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], [[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    half = 20 * wavelength
    plate = trimesh.Trimesh(
        [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    ball = trimesh.creation.icosphere(subdivisions=2, radius=4 * wavelength).apply_translation([0, 0, 4.8 * wavelength])
    angles = (np.array([0.5, 0.9]), np.array([0.2, 0.7]))
    for name, mesh in (("trihedral, leg 0.1 m", corner), ("ball on a plate", trimesh.util.concatenate([plate, ball]))):
        body = load_body(mesh)
        finest = SbrSettings(ray_spacing=0.5, edge_spacing=1 / 32)
        reference = scattering_matrix(body, 77e9, *angles, settings=finest)
        print(f"  {name}")
        for ray, edge in ((8, 4), (4, 2), (2, 1), (1, 0.5), (1, 0.25), (1, 0.125), (0.25, 0.25), (4, 0.25)):
            settings = SbrSettings(ray_spacing=ray, edge_spacing=edge)
            timing = measure(lambda s=settings, b=body: scattering_matrix(b, 77e9, *angles, settings=s), 1, 0)
            found = scattering_matrix(body, 77e9, *angles, settings=settings)
            error = np.abs(found - reference).max() / np.abs(reference).max()
            mark = "  <- default" if (ray, edge) == (1.0, 0.25) else ""
            print(
                f"    ray_spacing {ray:5g}  edge_spacing {edge:6g}  error {error:.1e}  cpu {timing.cpu / 2:.3f} s{mark}"
            )
        for share in (1.0, 0.5, 0.25, 0.125, 0.0625):
            settings = SbrSettings(corner_share=share)
            timing = measure(lambda s=settings, b=body: scattering_matrix(b, 77e9, *angles, settings=s), 1, 0)
            found = scattering_matrix(body, 77e9, *angles, settings=settings)
            error = np.abs(found - reference).max() / np.abs(reference).max()
            print(f"    corner_share {share:6g}  error {error:.1e}  cpu {timing.cpu / 2:.3f} s")


def bench_car(phi_deg: float = 150.0, count: int = 3) -> None:
    """Error of the RCS averaged over 1 deg of azimuth, and CPU seconds an aspect, against the finest default."""
    body = load_body(actor_parts(load_scene("highway_guardrail"), "car_ahead"))
    phi = np.deg2rad(phi_deg + np.linspace(-0.5, 0.5, count))

    def smoothed(settings: SbrSettings) -> tuple[np.ndarray, float]:
        scattering_matrix(body, 77e9, np.pi / 2, phi[:1], settings=SbrSettings(ray_spacing=32, edge_spacing=16))
        start = time.process_time()
        found = scattering_matrix(body, 77e9, np.pi / 2, phi, settings=settings)
        cpu = (time.process_time() - start) / count
        return 10 * np.log10(4 * np.pi * np.mean(np.abs(found) ** 2, axis=0)), cpu

    default = SbrSettings().for_size(body.size * 77e9 / SPEED_OF_LIGHT)
    print(f"\nCar of {len(body.triangles.normal)} faces, {phi_deg:g} deg, mean over 1 deg ({count} aspects), 77 GHz")
    print(
        "| ray_spacing | edge_spacing | max_depth | bisections | VV error [dB] | HH [dB] | HV [dB] | CPU s an aspect |"
    )
    print("|---|---|---|---|---|---|---|---|")
    finest = SbrSettings(ray_spacing=1.0, edge_spacing=0.25, bisections=11)
    reference, cpu = smoothed(finest)
    cases = [finest] + [
        SbrSettings(ray_spacing=ray, edge_spacing=edge, max_depth=depth, bisections=5)
        for ray, edge, depth in ((4, 2, 3), (8, 4, 3), (16, 8, 3), (32, 16, 3), (16, 8, 2))
    ]
    points = []
    for settings in cases:
        level, seconds = (reference, cpu) if settings is finest else smoothed(settings)
        error = level - reference
        points.append((settings, seconds, max(abs(error[0, 0]), abs(error[1, 1]))))
        marks = " (default)" if settings == default else " (centres)" if settings.max_depth == 2 else ""
        print(
            f"| {settings.ray_spacing:g}{marks} | {settings.edge_spacing:g} | "
            f"{settings.max_depth} | {settings.bisections} "
            f"| {error[0, 0]:+.2f} | {error[1, 1]:+.2f} | {error[1, 0]:+.2f} | {seconds:.2f} |",
            flush=True,
        )
    axes, save = chart("CPU seconds an aspect", "error of the co-polar RCS, mean over 1 deg [dB]", "rcs_car.png")
    axes.set_title(f"ss.rcs of a car of {len(body.triangles.normal)} faces at 77 GHz, rays and depth")
    for settings, seconds, error in points[1:]:
        axes.loglog(
            seconds, error, "s" if settings == default else "o", color="C1" if settings.max_depth == 2 else "C0"
        )
        name = f"{settings.ray_spacing:g} / {settings.edge_spacing:g}, depth {settings.max_depth}"
        axes.annotate(
            name + (" (default)" if settings == default else ""), (seconds, error), (5, 5), textcoords="offset points"
        )
    axes.axhline(0.5, color="0.5", linewidth=0.8, linestyle="--")
    axes.margins(x=0.3, y=0.1)  # room for the names
    save()


def bench_slope() -> None:
    """Error of spheres against PO's closed form of the smooth sphere and against Mie, over the tessellation."""
    from tests.oracles import rcs as oracle

    theta, phi = np.linspace(0.2, 2.8, 8), np.linspace(0.1, 5.0, 8)
    axes, save = chart("edge of the facets / radius", "rms error [dB]", "rcs_tessellation.png")
    print("\nSphere: rms error over 8 aspects [dB] against PO of the smooth sphere, and against Mie")
    print("| ka | faces | edge / radius | against PO [dB] | against Mie [dB] |\n|---|---|---|---|---|")
    for number, ka in enumerate((50.0, 150.0, 500.0)):
        smooth, mie = (dbsm(value) for value in (oracle.sphere_physical_optics(ka), oracle.mie_sphere(ka)))
        edges, errors = [], []
        for level in (3, 4, 5, 6) if ka < 500 else (4, 5, 6, 7):
            mesh = trimesh.creation.icosphere(subdivisions=level, radius=1.0)
            sigma = 10 * np.log10(rcs(mesh, ka * SPEED_OF_LIGHT / (2 * np.pi), theta, phi) / np.pi)
            edges.append(float(mesh.edges_unique_length.mean()))
            errors.append([float(np.sqrt(np.mean((sigma - exact) ** 2))) for exact in (smooth, mie)])
            print(
                f"| {ka:g} | {len(mesh.faces)} | {edges[-1]:.4f} | {errors[-1][0]:.4f} | {errors[-1][1]:.4f} |",
                flush=True,
            )
        against_po, against_mie = np.array(errors).T
        steep = np.polyfit(np.log(edges[1:]), np.log(against_po[1:]), 1)[0]
        axes.loglog(edges, against_po, "o-", color=f"C{number}", label=f"ka {ka:g}, against PO: slope {steep:.1f}")
        axes.loglog(edges, against_mie, "s:", color=f"C{number}", label=f"ka {ka:g}, against Mie")
    axes.axhline(0.2, color="0.5", linewidth=0.8, linestyle="--")
    axes.legend(fontsize=8)
    axes.set_title("Sphere: error against tessellation; dashed: 0.2 dB")
    save()


def bench_fullwave() -> None:
    """Difference from moments, shape by shape, by the statistics of docs/rcs.md."""
    from tests.physics.test_rcs_reference import full_wave_difference

    print("\nss.rcs minus method of moments [dB]")
    print(
        "| body and cut | channel | at the centre | mean over 10 deg | mean of the "
        "absolute value | listed |\n|---|---|---|---|---|---|"
    )
    listed = {"plate": "+0.18 at the centre", "dihedral3lam_az": "+1.4, mean", "trihedral": "0.2 to 0.5, absolute"}
    for name, axis, centre in (
        ("plate3lam_phi0", "theta_deg", 0.0),
        ("plate3lam_phi45", "theta_deg", 0.0),
        ("dihedral3lam_az", "phi_deg", 45.0),
        ("dihedral3lam_el", "theta_deg", 90.0),
        ("trihedral3lam_az", "phi_deg", 45.0),
        ("trihedral3lam_el", "theta_deg", 54.5),
        ("cyl_a1_h5_theta", "theta_deg", 90.0),
    ):
        bar = next((text for key, text in listed.items() if name.startswith(key)), "not listed")
        for channel in ("vv", "hh"):
            near = full_wave_difference(name, axis, centre, 0.3, channel)
            wide = full_wave_difference(name, axis, centre, 10.0, channel)
            print(
                f"| {name} | {channel.upper()} | {near[len(near) // 2]:+.2f} | {wide.mean():+.2f} "
                f"| {np.abs(wide).mean():.2f} | {bar} |",
                flush=True,
            )


def chart(across: str, up: str, name: str):
    """Return axes and a function that writes them to docs/figures."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    axes.grid(alpha=0.3, which="both")

    def save() -> None:
        path = FIGURES / name
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=130)
        print(f"  figure {path.name}")

    return axes, save


def main() -> None:
    chosen = sys.argv[1:] or ["sphere", "knobs"]
    known = {
        "sphere": bench_sphere,
        "knobs": bench_knobs,
        "car": bench_car,
        "slope": bench_slope,
        "fullwave": bench_fullwave,
    }
    print(machine())
    for name in chosen:
        known[name]()
    print(f"\nlargest memory {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
