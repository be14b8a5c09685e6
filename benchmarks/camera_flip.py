"""Camera: CPU time against FLIP, by samples, sampler and denoiser, in places and lights on which nothing was tuned.

    pip install 'scarl-sionna[flip]'
    python benchmarks/camera_flip.py measure --references FOLDER --results FILE [--samplers] [--views NAME ...]
    python benchmarks/camera_flip.py show --results FILE [--figures docs/figures]

FLIP [1] is the difference that a person sees who flips between two images. It is taken of developed 8-bit images, in
the middle of a quarter of an image of draft size, against a reference of 4,096 samples (kept in FOLDER; a place takes
1 to 3 CPU min). CPU seconds are those of that quarter, its kernels compiled and traced anew.

[1] P. Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech.
3(2), 2020.
"""

from __future__ import annotations

import argparse
import importlib
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from harness import machine
from scipy.ndimage import gaussian_filter

import scarl_sionna as ss
from benchmarks.row_files import append_rows, read_rows
from camera_lidar.camera import render
from camera_lidar.camera.develop import develop
from camera_lidar.camera.shutter import bands
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.light import ray_table, recording
from scarl_sionna.engine.threads import few_threads

Array = npt.NDArray[np.float64]

DRAFT = CameraSpec(width=480, height=270, images=("rgb",))
RENDERED, COMPARED = (240, 136), (128, 72)
"""Width and height of what is rendered, and of its middle, which is compared [px]."""
DOWN = 13
"""By how much both lie below the middle of the image [px]."""
COUNTS = (4, 8, 16, 32)
DEFAULT = "multijitter"
DRAFT_SAMPLES = 8
ROOF = Pose([0.3, 0.0, 1.62])
"""vehicle_from_sensor."""


class View(NamedTuple):
    """A place, its variant and light, and a time [s]."""

    scene: str
    variant: int
    lighting: str
    time: float


VIEWS = {
    "road-day": View("country_road", 4, "day", 1.5),
    "town-day": View("signalised_crossing", 3, "day", 2.0),
    "street-overcast": View("urban_crossing", 6, "overcast", 1.0),
    "suburb-dusk": View("suburban_street", 7, "dusk", 1.0),
    "motorway-rain": View("motorway", 3, "rain", 1.0),
    "ring-night": View("roundabout", 5, "night", 1.5),
    "town-night": View("urban_crossing", 8, "night", 2.0),
    "tunnel": View("tunnel", 4, "day", 1.0),
}


SAMPLERS = {"independent": (16,), "stratified": (16,), "ldsampler": (16,), "orthogonal": (25,)}
"""Mitsuba's other samplers, and samples of one launch: squares, for the last one of primes."""
denoising = importlib.import_module("camera_lidar.camera.denoise")
DENOISERS: dict[str, dict[str, Any]] = {
    "fast filter": {"QUALITY": "fast"},
    "clean guides": {"CLEAN_GUIDES": True},
    "balanced filter, clean guides": {"QUALITY": "balanced", "CLEAN_GUIDES": True},
    "fast filter, clean guides": {"QUALITY": "fast", "CLEAN_GUIDES": True},
}


class Place(NamedTuple):
    """A state with all that develops its images."""

    state: Any
    pose: Pose
    gain: float


def place_of(view: View) -> Place:
    world = ss.load_scene(view.scene, variant=view.variant).with_lighting(view.lighting)
    state = world.at(view.time)
    gain = float(world.document.info.get("exposure", world.lighting.exposure))
    return Place(state, state.actor_pose(world.ego).compose(ROOF), gain)


def spec_of(size: tuple[int, int]) -> CameraSpec:
    """Return a camera that sees the middle of a draft's image, width x height, by the same rays."""
    (fx, _, cu), (_, fy, cv), _ = DRAFT.intrinsics.tolist()
    width, height = size
    middle = cu - (DRAFT.width - width) / 2.0, cv - (DRAFT.height - height) / 2.0 - DOWN
    return DRAFT.with_(width=width, height=height, focal_length_px=(fx, fy), principal_point=middle)


def reference(name: str, place: Place, folder: Path, samples: int) -> Array:
    """Return the radiance of what is compared by many samples, kept as a file."""
    path = folder / f"{name}_{samples}.npy"
    if not path.exists():
        begin = time.process_time()
        spec = spec_of(COMPARED).with_(samples_per_pixel=samples, denoise=False)
        with few_threads():
            radiance = render.render_radiance(place.state, spec, place.pose, np.random.default_rng(1))
        print(f"reference {name}: {time.process_time() - begin:.0f} CPU s", flush=True)
        folder.mkdir(parents=True, exist_ok=True)
        np.save(path, radiance)
    return np.load(path)


def error(radiance: npt.NDArray[Any], place: Place, against: Array) -> float:
    """Return the mean FLIP, at 67 pixels a degree, of a rendered quarter against the reference in its middle."""
    import flip_evaluator

    left, top = (RENDERED[0] - COMPARED[0]) // 2, (RENDERED[1] - COMPARED[1]) // 2
    own = radiance[top : top + COMPARED[1], left : left + COMPARED[0]]
    pair = (develop(image, DRAFT, np.random.default_rng(0), place.gain) for image in (against, own))
    pair = (image.astype(np.float32) / 255.0 for image in pair)
    return float(flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)[1])


class Bench:
    """Renders a place in all ways and keeps rows: what, samples, denoised, FLIP, CPU seconds."""

    def __init__(self, name: str, place: Place, against: Array) -> None:
        self.name, self.place, self.against = name, place, against
        self.rows: list[dict[str, Any]] = []
        self.warm: set[tuple[object, ...]] = set()

    def traced(self, samples: int, seed: int = 7) -> tuple[Any, float, float]:
        """Return what is traced of an image, the CPU seconds of the light paths, and those of albedo and normals."""
        spec = spec_of(RENDERED).with_(samples_per_pixel=samples)
        if (samples, render.ROULETTE_DEPTH, ray_table.SAMPLER) not in self.warm:
            self.warm.add((samples, render.ROULETTE_DEPTH, ray_table.SAMPLER))
            with few_threads(), changed(recording, _recorded=lambda *_: None):
                render.render_radiance(self.place.state, spec, self.place.pose, np.random.default_rng(0))
        traced, guiding = render._Traced.black(spec), [0.0]
        state, guides = self.place.state, render._guides

        def timed(*given: Any) -> Any:
            begin = time.process_time()
            found = guides(*given)
            guiding[0] += time.process_time() - begin
            return found

        begin = time.process_time()
        with few_threads(), changed(render, _guides=timed), changed(recording, _recorded=lambda *_: None):
            for band in bands(state, spec, self.place.pose, Twist()):
                traced.add(band, Twist(), seed, render.has_lamps(state))
        return traced, time.process_time() - begin - guiding[0], guiding[0]

    def add(self, what: str, samples: float, traced: tuple[Any, float, float], both: bool = True) -> None:
        """Keep and print rows of what is traced: denoised and, if `both`, as it is."""
        for denoised in (False, True) if both else (True,):
            begin = time.process_time()
            radiance = traced[0].finished(self.place.state, denoised)
            cpu = traced[1] + (traced[2] + time.process_time() - begin if denoised else 0.0)
            flip = error(radiance, self.place, self.against)
            row = {"view": self.name, "what": what, "samples": samples, "denoise": denoised, "flip": flip, "cpu": cpu}
            self.rows.append(row)
            print(f"| {self.name} | {what} | {samples:g} | {denoised} | {flip:.4f} | {cpu:.2f} |", flush=True)


@contextmanager
def changed(module: Any, **values: Any) -> Iterator[None]:
    """Return a context manager in which names of a module have other values."""
    before = {name: getattr(module, name) for name in values}
    for name, value in values.items():
        setattr(module, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(module, name, value)


def measure(name: str, place: Place, against: Array, samplers: bool) -> list[dict[str, Any]]:
    """Return the rows of a view."""
    bench = Bench(name, place, against)
    for count in COUNTS:
        traced = bench.traced(count)
        bench.add(DEFAULT, count, traced)
        if count == DRAFT_SAMPLES:
            for option, values in DENOISERS.items():
                with changed(denoising, **values):
                    bench.add(option, count, traced, both=False)
            with changed(render, GUIDE_SAMPLES=4):
                bench.add("guides of 4 samples", count, bench.traced(count), both=False)
            with changed(render, ROULETTE_DEPTH=2):
                bench.add("roulette from 2", count, bench.traced(count))
    for sampler, counts in SAMPLERS.items() if samplers else ():
        with changed(ray_table, SAMPLER=sampler), changed(render, launch_samples=lambda samples, most=None: [samples]):
            for count in counts:
                bench.add(sampler, count, bench.traced(count))
    if samplers:
        adaptive(bench)
    return bench.rows


def adaptive(bench: Bench) -> None:
    """Add images of 8 samples in the mean: 4 everywhere, and more where two halves of those differ, up to 32.

    An upper bound of what adaptive samples may gain: launches for chosen pixels alone cost nothing here.
    """
    place, passes = bench.place, [bench.traced(2, seed)[0] for seed in range(16)]
    reflected, shining = (np.array([getattr(one, of) for one in passes]) for of in ("reflected", "shining"))
    guides = np.mean([one.guides for one in passes[:4]], axis=0)
    seen = [
        develop(image, DRAFT, np.random.default_rng(0), place.gain).astype(float) for image in (reflected + shining)[:2]
    ]
    spread = np.sqrt(gaussian_filter(((seen[0] - seen[1]) ** 2).sum(axis=-1), 2.0))
    low, high = 0.0, 1e6
    for _ in range(60):  # by which factor of the spread 8 samples are taken in the mean
        factor = 0.5 * (low + high)
        counts = np.clip(np.round(factor * spread / spread.max()), 0, 14) + 2
        low, high = (factor, high) if counts.mean() < DRAFT_SAMPLES / 2 else (low, factor)
    for what, own in (("adaptive", counts), ("even, in passes of 2", np.full_like(counts, DRAFT_SAMPLES / 2))):
        chosen = (np.arange(16)[:, None, None] < own)[..., None]
        means = [(part * chosen).sum(axis=0) / own[..., None] for part in (reflected, shining)]
        bench.add(what, DRAFT_SAMPLES, (render._Traced(*means, guides), float("nan"), 0.0))


def show(rows: list[dict[str, Any]]) -> None:
    """Print the tables of docs/camera.md."""
    views = list(dict.fromkeys(row["view"] for row in rows))

    def mean(view: str, what: str, samples: float, denoise: bool, key: str = "flip") -> float:
        found = [
            row[key]
            for row in rows
            if (row["view"], row["what"], row["denoise"]) == (view, what, denoise)
            and abs(row["samples"] - samples) < 0.3
        ]
        return float(np.mean(found)) if found else float("nan")

    def cell(value: float, form: str) -> str:
        return format(value, form) if np.isfinite(value) else "–"

    def usual(view: str, samples: float, denoise: bool) -> float:
        """Return the FLIP of the default sampler, between the measured numbers of samples linear in logarithms."""
        known = np.log([mean(view, DEFAULT, count, denoise) for count in COUNTS])
        return float(np.exp(np.interp(np.log(samples), np.log(COUNTS), known)))

    print("\n| view | " + " | ".join(f"{n}, {d}" for n in COUNTS for d in ("as traced", "denoised")) + " |")
    print("|---" * (1 + 2 * len(COUNTS)) + "|")
    for view in views:
        cells = [
            f"{cell(mean(view, DEFAULT, n, d), '.4f')} ({cell(mean(view, DEFAULT, n, d, 'cpu'), '.2f')} s)"
            for n in COUNTS
            for d in (False, True)
        ]
        print(f"| {view} | " + " | ".join(cells) + " |")
    others = [what for what in dict.fromkeys(row["what"] for row in rows) if what != DEFAULT]
    print("\n| instead | " + " | ".join(views) + " |\n|---" + "|---" * len(views) + "|")
    for what in others:
        for denoise in (False, True):
            for samples in sorted(
                {row["samples"] for row in rows if row["what"] == what and row["denoise"] == denoise}
            ):
                base = "even, in passes of 2" if what == "adaptive" else DEFAULT
                cells = []
                for view in views:
                    plain = mean(view, base, samples, denoise) if base != DEFAULT else usual(view, samples, denoise)
                    cells.append(cell(mean(view, what, samples, denoise) / plain, ".2f"))
                print(f"| {what}, {samples:g}{', denoised' if denoise else ''} | " + " | ".join(cells) + " |")


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw FLIP against CPU time, one panel a view, draft and default marked."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    views = list(dict.fromkeys(row["view"] for row in rows if row["what"] == DEFAULT and np.isfinite(row["cpu"])))
    figure, panels = plt.subplots(1, len(views), figsize=(3.4 * len(views), 3.2), layout="constrained", squeeze=False)
    for axis, view in zip(panels.ravel(), views, strict=True):
        for denoise, style in ((False, "o--"), (True, "s-")):
            own = [r for r in rows if (r["view"], r["what"], r["denoise"]) == (view, DEFAULT, denoise)]
            points = [
                [np.median([r[key] for r in own if r["samples"] == n]) for key in ("cpu", "flip")] for n in COUNTS
            ]
            line = np.array(points)
            axis.loglog(line[:, 0], line[:, 1], style, label="denoised" if denoise else "as traced", markersize=4)
            for count, (x, y) in zip(COUNTS, points, strict=True):
                mark = {8: " draft", 16: " default"}.get(count, "") if denoise else ""
                axis.annotate(f"{count}{mark}", (x, y), textcoords="offset points", xytext=(3, 4), fontsize=7)
        axis.set_title(view, fontsize=9)
        axis.set_xticks([0.3, 0.5, 1, 2, 3, 5])
        axis.set_yticks([0.04, 0.06, 0.08, 0.1, 0.15, 0.2])
        for one in (axis.xaxis, axis.yaxis):
            one.set_major_formatter(ScalarFormatter())
            one.set_minor_formatter(NullFormatter())
        axis.tick_params(labelsize=7)
        axis.margins(0.2)
        axis.grid(True, which="both", alpha=0.3)
    panels[0, 0].legend(fontsize=7)
    figure.supxlabel("CPU time of a quarter of a draft's image [s]", fontsize=9)
    figure.supylabel("mean FLIP against 4,096 samples", fontsize=9)
    figure.savefig(path, dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("references", "measure", "show"))
    parser.add_argument("--views", nargs="*", default=list(VIEWS), choices=list(VIEWS))
    parser.add_argument("--references", type=Path)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--results", type=Path, help="JSON lines; measured views are added")
    parser.add_argument("--samplers", action="store_true", help="other samplers and adaptive samples, too")
    parser.add_argument("--figures", type=Path)
    args = parser.parse_args()
    warnings.simplefilter("ignore", ScarlWarning)
    if args.what == "show":
        rows = read_rows(args.results)
        show(rows)
        if args.figures:
            draw(rows, args.figures / "camera_flip.png")
        return
    print(machine())
    for name in args.views:
        place = place_of(VIEWS[name])
        against = reference(name, place, args.references, args.reference_spp)
        if args.what == "measure":
            found = measure(name, place, against, args.samplers)
            append_rows(args.results, *found)


if __name__ == "__main__":
    main()
