"""Contents and losses of each format of files: measured by writing and reading, or said by its writer.

A cloud of a few points with every attribute goes through each format of clouds; a short road through each format of
the geometric-semantic model, whose writers report what they leave out. Sweeps and scenes state it in their tables.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..base.errors import InputError, nearest_name
from ..cloud.flags import FLAGS
from ..cloud.formats.registry import ENDINGS, open_cloud, open_writer, writer_file
from ..cloud.formats.registry import missing_package as missing_cloud_package
from ..cloud.layers import ATTRIBUTES, STORED_TYPES, columns
from ..cloud.points import POINT_TYPES, PointBlock, concatenate, make_block
from ..cloud.sweeps.registry import ENTRIES as SWEEP_ENTRIES
from ..sampling.road import sample_road
from ..scenario.road import RoadScenario
from ..twin.formats import FORMATS, missing_package, report_file_name, write_twin
from ..twin.scene.registry import ENTRIES as SCENE_ENTRIES

_CODE = Path(__file__).parents[1]
_POINTS = 64
_PLACE = (294_000.25, 5_628_000.75, 180.5)
"""Map coordinates of the points, m, as large as those of usual maps are."""
_SCALE = 65_535.0
_EPSG = 25_832
_ROAD_LENGTH = 120.0
_UNITS = (
    dict.fromkeys(("xyz", "range", "true_range", "true_xyz", "scanner"), "m")
    | {"gps_time": "s", "power_db": "dB"}
    | dict.fromkeys(("scan_angle_deg", "incidence_deg"), "deg")
)
_SINGLE = 2.0**-23
"""Relative error of single precision, in which intensities count as kept."""
_LABELS = {
    "xyz": "coordinates",
    "rgb": "colours",
    "class_id": "class",
    "instance_id": "instance",
    "gps_time": "time",
    "scan_angle_deg": "scan angle",
    "incidence_deg": "incidence",
    "return_number": "return",
    "number_of_returns": "returns",
    "color_source": "colour source",
    "true_xyz": "true position",
    "true_range": "true range",
    "power_db": "power",
}
_CLIPPED = 0.1
_CLOUD_LABELS = {".copc.laz": "COPC"}


@dataclass(frozen=True)
class FormatLosses:
    """Description of a format: what it holds, and what it loses.

    Attributes:
        name: as it is given to a scenario.
        kind: ``cloud``, ``sweeps``, ``scene`` or ``twin``.
        label: for people.
        file: name of what it writes.
        source: file with its writer.
        holds, loses: in words, each item by itself.
    """

    name: str
    kind: str
    label: str
    file: str
    source: Path
    holds: tuple[str, ...]
    loses: tuple[str, ...]


def format_names(kinds: Collection[str] = ()) -> list[str]:
    """Return the names of the formats of some kinds, or of all; in the order of clouds, sweeps, scenes and models."""
    names: dict[str, Iterable[str]] = {
        "cloud": [ending.removeprefix(".") for ending in ENDINGS],
        "sweeps": SWEEP_ENTRIES,
        "scene": SCENE_ENTRIES,
        "twin": FORMATS,
    }
    return [name for kind in kinds or names for name in names[kind]]


def format_losses(name: str) -> FormatLosses:
    """Return what a format holds and loses.

    Raises:
        InputError: there is no format of this name; the nearest is suggested.
    """
    if f".{name}" in ENDINGS:
        ending = f".{name}"
        held, lost = _cloud_losses(ending)
        label = _CLOUD_LABELS.get(ending, name.upper())
        return FormatLosses(name, "cloud", label, f"cloud{ending}", writer_file(ending), held, lost)
    if name in SWEEP_ENTRIES:
        sweeps = SWEEP_ENTRIES[name]
        source = _CODE / "cloud" / "sweeps" / f"{sweeps.writer[0]}.py"
        return FormatLosses(
            name, "sweeps", sweeps.label, sweeps.file, source, _split(sweeps.holds), _split(sweeps.loses)
        )
    if name in SCENE_ENTRIES:
        scene = SCENE_ENTRIES[name]
        source = _CODE / "twin" / "scene" / f"{scene.writer[0]}.py" if scene.writer else _CODE / "blender" / "files.py"
        return FormatLosses(name, "scene", scene.label, scene.file, source, _split(scene.holds), _split(scene.loses))
    if name in FORMATS:
        twin = FORMATS[name]
        source = (_CODE / "twin").joinpath(*twin.module.removeprefix(".").split(".")).with_suffix(".py")
        return FormatLosses(name, "twin", twin.label, twin.file, source, (twin.description,), _twin_losses(name))
    names = format_names()
    raise InputError("formats", name, f"must be one of {', '.join(names)}{nearest_name(name, names)}")


def _split(text: str) -> tuple[str, ...]:
    """Return the parts of a text between semicolons."""
    return tuple(part.strip() for part in text.split(";"))


@cache
def _sample() -> PointBlock:
    """Return points with every attribute that a cloud can have, of values that no format rounds to by chance."""
    rng = np.random.default_rng(5)
    arrays: dict[str, np.ndarray] = {}
    sizes: dict[str, int] = {}
    for column in columns(ATTRIBUTES):
        sizes[column.array] = max(sizes.get(column.array, 1), 1 + (column.component or 0))
    for name, (kind, size) in POINT_TYPES.items():
        arrays[name] = _values(rng, np.dtype(kind), size)
    for column in columns(ATTRIBUTES):
        if column.array not in arrays:
            stored_type = np.dtype(STORED_TYPES[column.array])
            arrays[column.array] = _values(rng, stored_type, sizes[column.array])
    arrays["xyz"] = rng.uniform(-200.0, 200.0, (_POINTS, 3)) + _PLACE
    arrays["intensity"] = rng.uniform(0.0, 1.5, _POINTS)  # some brighter than 16 bits hold
    arrays["gps_time"] = np.sort(rng.uniform(0.0, 1e3, _POINTS))
    arrays["return_number"] = np.ones(_POINTS, np.uint8)
    arrays["number_of_returns"] = np.full(_POINTS, 3, np.uint8)
    arrays["class_id"] = rng.integers(0, 17, _POINTS).astype(np.uint8)
    arrays["scan_angle_deg"] = rng.uniform(-90.0, 90.0, _POINTS).astype(np.float32)
    for name in ("scanner", "true_xyz"):
        if name in arrays:
            arrays[name] = arrays["xyz"] + rng.uniform(-1.0, 1.0, (_POINTS, 3))
    if "normal" in arrays:
        normal = rng.standard_normal((_POINTS, 3))
        arrays["normal"] = (normal / np.linalg.norm(normal, axis=1)[:, None]).astype(np.float32)
    return make_block(**arrays)


def _values(rng: np.random.Generator, kind: np.dtype, size: int) -> np.ndarray:
    """Return random values of a type, (`_POINTS`,) or (`_POINTS`, size)."""
    shape = _POINTS if size == 1 else (_POINTS, size)
    if kind.kind == "f":
        return rng.uniform(0.01, 0.99, shape).astype(kind)
    return rng.integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True)


@cache
def _cloud_losses(ending: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what comes back exactly of the sample cloud through a format, and what is rounded or missing."""
    if package := missing_cloud_package(ending):
        return (), (f"not measured: {package} is not installed",)
    sample = _sample()
    flagged = sample.with_arrays({name: np.arange(_POINTS) % 2 == 0 for name in FLAGS})
    with TemporaryDirectory() as folder:
        back, with_flags = (_through(Path(folder) / f"{name}{ending}", block) for name, block in (
            ("plain", sample), ("flagged", flagged)
        ))  # fmt: skip
    exact, lost = [], []
    for name, values in sample.attributes().items():
        label, found = _LABELS.get(name, name.replace("_", " ")), back.array(name)
        if found is None:
            lost.append(f"without {label}")
            continue
        error = float(np.abs(found.astype(np.float64) - values.astype(np.float64)).max())
        if name == "intensity" and error > _CLIPPED:
            lost.append(f"{label} to 16 bits, and clipped beyond")
        elif name == "rgb" and error:
            lost.append(f"{label} to 8 bits")
        elif error > (_SINGLE if name == "intensity" else 0.0):
            lost.append(f"{label} to {_rounded(error)} {_UNITS.get(name, '')}".strip())
        else:
            exact.append(label)
    kept = [name for name in FLAGS if name in with_flags.more and with_flags.more[name].any()]
    (exact if len(kept) == len(FLAGS) else lost).append("flags" if len(kept) == len(FLAGS) else "without flags")
    return tuple(exact), tuple(lost)


def _through(path: Path, block: PointBlock) -> PointBlock:
    """Return a block of points written to a file and read again, in the order of their times."""
    with open_writer(path, _EPSG, np.array(_PLACE), _SCALE, ATTRIBUTES) as writer:
        writer.write(block)
    with open_cloud(path) as cloud:
        points = concatenate(list(cloud.blocks()))
    return points.select(np.argsort(points.gps_time, kind="stable"))


def _rounded(error: float) -> str:
    """Return an error rounded up to one digit."""
    exponent = int(np.floor(np.log10(error)))
    return f"{np.ceil(error / 10.0**exponent - 1e-6) * 10.0**exponent:.1g}"


@cache
def _twin_losses(name: str) -> tuple[str, ...]:
    """Return what a format of the geometric-semantic model leaves out of a short road with one of many things."""
    if package := missing_package(name):
        return (f"not measured: {package} is not installed",)
    road = sample_road(RoadScenario(length=_ROAD_LENGTH), seed=1)
    with TemporaryDirectory() as folder:
        write_twin(road, Path(folder), [name])
        report = json.loads((Path(folder) / report_file_name(name)).read_text(encoding="utf-8"))
    return tuple(_sentences(report, {key: type(item).__name__ for key, item in road.objects.items()}))


def _sentences(report: dict[str, list[dict[str, str]]], types: dict[str, str]) -> Iterator[str]:
    """Yield a sentence for each type of thing that a report says is lost or reduced, with the reason."""
    told: dict[str, dict[str, None]] = {}
    for row in [*report["lost"], *report["reduced"]]:
        kind = types.get(row["id"].partition("/")[0], "")
        reason = row["reason"]
        if "nothing of it is on the road" not in reason:
            told.setdefault(reason or "left out", {})[kind] = None
    for reason, kinds in told.items():
        yield f"{', '.join(kinds)}: {reason}"
