"""The page of the dataset's schema, made from the schema's code.

``python -m scarl_sionna.dataset.schema_docs > docs/dataset.md``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from scarl_sionna.core.semantics import SEMANTIC_CLASSES

from .codec import DEPTH_FORMULA
from .encoding import StoreOptions
from .schema import ADC_COMPLEX, DEPTH_EXACT, SCHEMA_VERSION, TABLES, Field
from .store.manifest import CONVENTIONS

_TITLES = {
    "frame": "Frame (`arrays/<scene>/`)",
    "objects": "Objects (`arrays/<scene>/objects/`)",
    "camera": "Camera (`arrays/<scene>/<sensor>/`, `images/<scene>/<sensor>/`)",
    "lidar": "Lidar (`arrays/<scene>/<sensor>/`)",
    "radar": "Radar (`arrays/<scene>/<sensor>/`)",
    "scanning_radar": "Scanning radar (`arrays/<scene>/<sensor>/`)",
    "radio": "Radio (`arrays/<scene>/<sensor>/`)",
    "closed_radar": "Radar without raw data (`arrays/<scene>/<sensor>/`)",
}
_INTRODUCTION = """\
# The dataset

This page is made from the code (`python -m scarl_sionna.dataset.schema_docs > docs/dataset.md`); a test holds it up to date.
Schema version {version}. How a dataset is made is described in [export.md](export.md).

## Files

```
out/
  manifest.json                               configuration and its hash, calibration, conventions, schema, splits, checksums (its own, too)
  manifest.backup.json                        copy of the manifest, read where that is lost
  README.md                                   dataset card
  export.log                                  when and where it was made (not part of the data)
  shards/<scene>/000003.json                  record of a shard: its frames; size, SHA-256 and place of every member of the
  shards/<scene>/000003.zip                   ZIP file (stored, not compressed), whose members are, by name
    images/<scene>/front_center/rgb/rgb/000025.png
    arrays/<scene>/front_center/radar/adc/c/3/0/0/0/0     the chunks of a Zarr v3 array, whose first axis is the frame
    shards/<scene>/000003.frames.json         names and diagnostics of its frames
```

A **scene** is one drive (sequence) with its own scenario and seed. A **shard** is {shard_frames} consecutive frames of it by default (3 to 7 in a dataset of less than 32 frames, so that a few processes share it). So a dataset has two files a shard
and four more: 140,000 frames are 35,004 files, whatever the rig, if the scenes' lengths are multiples of {shard_frames} (else up to two more a scene):

```
find out -type f -not -path '*/.*' | wc -l
unzip out/shards/drive/000003.zip 'images/*' -d pictures      # or single ones by their names, with any ZIP program
scarl-sionna repack out/ files/ --layout files                # all of it
```

The last is the other **layout**, which `export --layout files` makes, too, and which datasets before schema version 3 have: each member is a file of its own under
its name, and `arrays/` is a Zarr v3 hierarchy with its `zarr.json` files, one group a scene, in it a group for each sensor.

An array has one chunk for each frame. A chunk is compressed with Blosc (zstd, level 5, bit shuffle) and ends with a CRC-32C, so
that every Zarr v3 reader sees damage. Reading a frame, or a part of it, reads that frame's chunk and nothing else.
`open_dataset` holds images and the JSON of a shard to the SHA-256 in the shard's record, the record to its own and to that in the manifest, and the manifest to its own,
also right after a kill, when the manifest does not list the last shards yet (a damaged record costs its frames then, with a warning, and the rest is read):
of 1,000 single bits flipped at random over all these files, in either layout, and of 500 in records that are not listed, none is read in silence
(`pytest tests/unit/test_reader_damage.py --run-slow`), for
3 % more CPU time of reading frames with images (`python benchmarks/readers.py --part checks`). The error names file and frame.

Lengths that differ from frame to frame (returns of a scan, objects) are filled with zeros to a capacity: all shots times
`max_returns`, and `object_capacity` = {object_capacity}. The zeros take no room on disk. `num_points` and `num_objects` tell how many entries are valid;
`open_dataset` cuts them off.

A field that a sensor did not make (an optional one of the lidar, an image not asked for) has no array and no folder. A frame that
could not be made has no chunk: Zarr shows the fill value there (0, nan), `open_dataset` leaves the frame out.

No file but `export.log` holds a time of day or a path of the machine. The same configuration gives the same bytes, for any number of
workers and any order of work, on the same versions and kind of processor.

## Fields
"""
_READING = """\
## Reading

```python
import scarl_sionna as ss

ds = ss.open_dataset("out")  # or "s3://bucket/out", "https://host/out": any fsspec address
frame = ds[12]  # nothing is read yet; frames of all scenes in order
frame.radar["front_center"].adc  # complex64; .adc_int: the codes; also ["front_center/radar"]
frame.image["front_center"].depth  # float32 [m]; .rgb, .semantic, .instance, .normal, .flow
frame.lidar["front_center"].position  # valid returns only
frame.radar_scan  # by name, empty where the rig has no scanning radar; each with .image, .azimuth, .time and the rest
frame.radio  # by name, empty where the rig has no radio; each with .cfr, .a, .tau, .doppler and the rest of the table
frame.labels  # true boxes; .label_arrays: the same as columns
frame.to_frame()  # the scarl_sionna.Frame that ss.observe returned
ds.scene("drive").group["front_center/radar/adc"][100:200, 0, :64]  # zarr.Array: slices over frames
ds.rig, ds.calibration, ds.splits, ds.sensors
```

`ds` may be used from several threads and sent to other processes. A dataset can be read while it is written: what is finished is
there. Without this package, `zarr`, `xarray` (`xarray.open_zarr("files/arrays/drive", group="front_center/radar",
consolidated=False)`), Pillow and `json` read everything in the layout `files`; of the layout `packed`, `zipfile` and Pillow read images.

All is as the sensors gave it, bit for bit, but: depth (16-bit code, within 7.6e-5 of the depth from 5 cm on, nearer is 5 cm; of cameras that see
80 deg or more off their axis, or beyond 1000 m, it is as it was), normals of the camera (float16, within 2.5e-4), and the times that something took, which are not stored.

A name in a file of a dataset that would lead out of its folder, also through a link, is not followed: it raises `DatasetError`.

## Versions

A reader reads every schema version up to its own, and refuses a newer one. A new optional field does not raise the version.

In datasets of before the depth of cameras that see 80 deg or more off their axis (fisheyes), or whose `max_distance` is above 1000 m, is a code, too: what is
behind the camera's plane, or nearer to it than `max_distance` / 20000, is that smallest depth there, wrongly, and has to be made again. Today such a camera has an array in
place of the images, which older readers do not see.

## Sensors of other packages

A sensor that is registered under the entry points `scarl.sensors` and returns one of their results (`RadarFrame` for instance) is stored
like a built-in one. One with a result of its own says on its class what is to be stored; without that, an export refuses it before
anything is simulated:

```python
from scarl_sionna.dataset.schema import Field


class Sonar:
    spec_type = SonarSpec
    result_type = SonarPing  # dataclass: spec, world_from_sensor, echo, kind = "sonar"
    stored_fields = (Field("echo", "float32", ("beam", "sample"), "Pa", "pressure"),)  # the same shape in every frame
```
"""


def schema_page() -> str:
    """Return the text of ``docs/dataset.md``."""
    options = StoreOptions().for_frames(1_000)
    head = _INTRODUCTION.format(
        version=SCHEMA_VERSION, shard_frames=options.shard_frames, object_capacity=options.object_capacity
    )
    parts = [head]
    for name, fields in TABLES.items():
        extra = {"radar": (ADC_COMPLEX,), "camera": (DEPTH_EXACT,)}.get(name, ())
        parts.append("\n".join([f"### {_TITLES[name]}", "", *_table((*fields, *extra)), ""]))
    parts.append("\n".join(["## Conventions", "", *_conventions(), ""]))
    parts.append(_READING)
    return "\n".join(parts)


def _table(fields: Iterable[Field]) -> Iterator[str]:
    yield "| field | type | axes after the frame | unit | meaning |"
    yield "|---|---|---|---|---|"
    for item in fields:
        kind = {"png": f"PNG, {item.dtype}", "json": "JSON"}.get(item.storage, item.dtype)
        yield f"| `{item.name}` | {kind} | {', '.join(item.axes)} | {item.unit} | {item.description} |"


def _conventions() -> Iterator[str]:
    yield from (f"- **{name}**: {text}" for name, text in CONVENTIONS.items())
    yield f"- **depth_formula**: {DEPTH_FORMULA}"
    yield "- **semantic_classes**: " + ", ".join(f"{index} {name}" for index, name in enumerate(SEMANTIC_CLASSES))


if __name__ == "__main__":
    print(schema_page(), end="")
