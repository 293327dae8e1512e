"""The knobs that trade speed for accuracy, the values that they are measured at, and the tables of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...scanning.platforms.path import USUAL
from ...scanning.platforms.platform import Platform
from ...scenario.colour import USUAL_RANGE, image_scale
from ...scenario.scenario import Scenario, load_scenario

SCENES = ("rq31-600m", "mobile-mapping-300m", "airborne-1000m")
"""Built-in scenarios that the trade-off is measured on: 60 m above the road, on it, and 700 m above it."""
BARE = ("colour.rgb=false", "scan.relief=0")
"""Changes that leave out what the knobs of the model and the beam don't touch."""
IMAGES = ("scan.relief=0", "colour.source=images")
WHOLE_PATHS = ("scan.relief=0", "colour.source=returns", "colour.lighting=path")
TRUE_SAMPLES = 256
"""Samples per pixel of the light that counts as true beside whole light paths."""
REPEATED = {"fidelity": 2}
"""Knobs whose rows are measured several times; the least time counts, and they say how far times scatter."""
ALIKE = 0.05
"""Errors count as equal up to this share: they are of stretches, and plants on another mesh stand elsewhere."""
_LENGTHS_OF_IMAGES = ("colour.image_spacing", "colour.ground_sampling_distance")


@dataclass(frozen=True)
class Knob:
    """A knob and the rows that are measured of it.

    Attributes:
        table: of `TABLES`, that the rows are in.
        rows: value -> changes of the scenario, as ``path=value``.
        errors: that are measured: ``height``, ``beam``, ``relief``, ``colour``.
        whole_paths: the true colours are those of whole light paths; else of direct lighting.
    """

    table: str
    rows: dict[Any, tuple[str, ...]]
    errors: tuple[str, ...]
    whole_paths: bool = False


def _field(path: str, values: Iterable[Any], common: tuple[str, ...]) -> dict[Any, tuple[str, ...]]:
    """Return the rows of one field of the scenario."""
    return {value: (*common, f"{path}={value}") for value in values}


_ALL_ERRORS = ("height", "beam", "relief", "colour")
_BETWEEN: dict[Any, tuple[str, ...]] = {
    f"{preset}, {title}": (f"fidelity={preset}", change)
    for preset, others in {
        "draft": (
            "geometric_tolerance=0.005",
            "vegetation_detail=1",
            "scan.rays_per_pulse=7",
            "scan.relief_octaves=4",
        ),
        "standard": (
            "geometric_tolerance=0.02",
            "geometric_tolerance=0.001",
            "vegetation_detail=0.3",
            "scan.rays_per_pulse=1",
            "scan.rays_per_pulse=19",
            "scan.relief_octaves=2",
            "scan.relief_octaves=6",
        ),
        "high": (
            "geometric_tolerance=0.005",
            "scan.rays_per_pulse=7",
            "scan.rays_per_pulse=37",
            "scan.relief_octaves=4",
        ),
    }.items()
    for change in others
    for title in [change.rpartition(".")[2] if change.startswith("scan.") else change]
}
"""Presets of which one knob is that of another: title -> changes."""

KNOBS: dict[str, Knob] = {
    "geometric_tolerance": Knob(
        "model and beam", _field("geometric_tolerance", (0.02, 0.01, 0.005, 0.002, 0.001), BARE), ("height", "beam")
    ),
    "vegetation_detail": Knob("model and beam", _field("vegetation_detail", (0, 0.3, 1), BARE), ("height", "beam")),
    "caster": Knob("model and beam", _field("scan.caster", ("bvhtree", "embree"), BARE), ("height", "beam")),
    "rays_per_pulse": Knob(
        "model and beam", _field("scan.rays_per_pulse", (1, 7, 19, 37, 61), BARE), ("height", "beam")
    ),
    "point_spacing": Knob(
        "points", {"none": BARE} | _field("cloud.point_spacing", (0.04, 0.1, 0.2), BARE), ("beam", "relief")
    ),
    "roughness_adjustment": Knob(
        "points", _field("scan.relief", (0, 1), ("colour.rgb=false",)), ("beam", "relief")
    ),
    "colour_source": Knob(
        "colours", _field("colour.source", ("material", "images", "returns"), ("scan.relief=0",)), ("colour",)
    ),
    "image_spacing": Knob("colours", _field("colour.image_spacing", (15, 30, 60), IMAGES), ("colour",)),
    "ground_sampling_distance": Knob(
        "colours", _field("colour.ground_sampling_distance", (0.06, 0.12, 0.25, 0.5), IMAGES), ("colour",)
    ),
    "samples": Knob(
        "light",
        {"direct": ("scan.relief=0", "colour.source=returns")} | _field("colour.samples", (4, 16, 64), WHOLE_PATHS),
        ("colour",),
        whole_paths=True,
    ),
    "fidelity": Knob(
        "presets",
        _field("fidelity", ("draft", "standard", "high"), ()),
        _ALL_ERRORS,
    ),
    "between": Knob("presets", _BETWEEN, _ALL_ERRORS),
}
"""Knobs by name. ``fidelity`` are the presets: points that set several knobs at once; ``between`` are presets with one
knob of another, which a preset must not be worse than."""

ROW_TITLES = {
    "height_mm": "road height, largest error (mm)",
    "position_mm": "hit position, 95 % (mm)",
    "intensity_percent": "intensity, 95 % (%)",
    "labels_percent": "points of another class (%)",
    "density_percent": "points too few (%)",
    "relief_mm": "micro-relief, 95 % (mm)",
    "colour_median": "colour, CIEDE2000 median",
    "colour_95": "colour, CIEDE2000 95 %",
    "layers_rmse": "material layers, RMSE",
}
"""Errors against truth and how they are measured: see `jobs.measure.rows`."""

_COSTS = {
    "seconds": ("processor time (s)", ".1f"),
    "model_seconds": ("of it model (s)", ".1f"),
    "image_seconds": ("of it images (s)", ".1f"),
    "peak_memory_mb": ("memory (MB)", ".0f"),
    "triangles": ("triangles", ",d"),
    "rays_per_second": ("rays/s", ",d"),
    "images": ("images", "d"),
    "megapixels": ("Mpx", ".1f"),
}
_SHARES = ("image", "next image", "nearby", "material", "return")

TABLES: dict[str, tuple[str, ...]] = {
    "model and beam": ("seconds", "model_seconds", "peak_memory_mb", "triangles", "rays_per_second"),
    "points": ("seconds", "peak_memory_mb"),
    "colours": ("seconds", "image_seconds", "peak_memory_mb", "images", "megapixels", *_SHARES),
    "light": ("seconds", "image_seconds", "peak_memory_mb"),
    "presets": ("seconds", "model_seconds", "image_seconds", "peak_memory_mb", "triangles"),
}
"""Table -> the columns of costs that it has, before those of the errors."""


def rows(knobs: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Yield (knob, value) of every row."""
    for knob in knobs:
        for value in KNOBS[knob].rows:
            yield knob, value


def row_scenario(scenario: str, knob: str, value: Any, changes: Iterable[str] = ()) -> Scenario:
    """Return the job that a row is about: the scenario with the knob's changes, and others before them.

    What a knob doesn't change is as in the standard fidelity, so that its errors aren't drowned by those of a coarser
    one. Spacings and pixels of images are those for a range of 60 m, and farther apart and coarser from farther away.
    """
    scale = image_scale(_seen_from(load_scenario(scenario).scan.platform))
    base = () if KNOBS[knob].table == "presets" else ("fidelity=standard",)
    return load_scenario(scenario, [*base, *changes, *(_scaled(change, scale) for change in KNOBS[knob].rows[value])])


def _seen_from(platform: Platform) -> float:
    usual = USUAL.get(platform.kind)
    return usual.seen_from(platform.height or usual.height) if usual else USUAL_RANGE


def _scaled(change: str, scale: float) -> str:
    path, _, value = change.partition("=")
    return f"{path}={float(value) * scale:g}" if path in _LENGTHS_OF_IMAGES else change


def measured_of(results: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the rows that this Blender could measure."""
    return [row for row in results if "left_out" not in row]


def time_noise(results: Iterable[Mapping[str, Any]]) -> float | None:
    """Return the measured noise of the times: how far those of one row are apart, as a share of their mean.

    The largest such spread of the rows that were measured `REPEATED` times; None if there is none.
    """
    several = [row["all_seconds"] for row in measured_of(results) if len(row.get("all_seconds", ())) > 1]
    return max(((max(times) - min(times)) * len(times) / sum(times) for times in several), default=None)


def better_row(
    row: Mapping[str, Any], others: Iterable[Mapping[str, Any]], noise: float
) -> Mapping[str, Any] | None:
    """Return a row that is faster than `row`, beyond the noise of time, and as accurate in all errors.

    Errors count as equal up to `ALIKE`. The fastest such row; None if there is none, so that `row` lies on the front.
    """

    def as_accurate(other: Mapping[str, Any]) -> bool:
        return all(abs(other["errors"][name]) <= (1.0 + ALIKE) * abs(error) for name, error in row["errors"].items())

    faster = [other for other in others if other["seconds"] < row["seconds"] * (1.0 - noise) and as_accurate(other)]
    return min(faster, key=lambda other: other["seconds"], default=None)


def front_lines(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a table of the presets that says of each whether it lies on the front; nothing without presets."""
    job = [row for row in measured_of(results) if KNOBS[row["knob"]].table == "presets"]
    presets = [row for row in job if row["knob"] == "fidelity"]
    if not presets:
        return []
    noise = time_noise(results)
    lines = ["| preset | on the front | faster, and as accurate in all errors |", "|---|---|---|"]
    for row in presets:
        other = better_row(row, [one for one in job if one is not row], noise or 0.0)
        shown = "-" if other is None else f"{other['value']}: {other['seconds']:.1f} s for {row['seconds']:.1f} s"
        lines.append(f"| {row['value']} | {'yes' if other is None else 'no'} | {shown} |")
    text = "times weren't measured twice, so every difference of time counts"
    if noise is not None:
        text = f"times of the same settings differ by up to {100.0 * noise:.0f} %: only what is faster by more counts"
    alike = f"errors that are larger by less than {100.0 * ALIKE:.0f} % count as equal"
    return [*lines, "", f"Each is compared with {len(job) - 1} others of the same job; {alike}; {text}."]


def markdown(results: Sequence[Mapping[str, Any]], scenario: str) -> str:
    """Return the tables of rows by `jobs.measure.rows.measure_row`, and what was left out of them and why."""
    machines = dict.fromkeys(row["machine"] for row in results if "machine" in row)
    lines = [f"Scene `{scenario}`: `synthroads tradeoff --scenario {scenario} --output DIR`; {'; '.join(machines)}", ""]
    for table, costs in TABLES.items():
        own = [row for row in results if KNOBS[row["knob"]].table == table]
        measured = measured_of(own)
        if measured:
            lines += [f"{table.capitalize()}:", "", *_table(measured, costs), ""]
        left_out = [f"- {row['knob']} {row['value']}: {row['left_out']}" for row in own if "left_out" in row]
        lines += [*left_out, ""] if left_out else []
    front = front_lines(results)
    lines += [*front, ""] if front else []
    scale = image_scale(_seen_from(load_scenario(scenario).scan.platform))
    if scale != 1.0 and any(KNOBS[row["knob"]].table == "colours" for row in results):
        lines += [f"Spacings and pixels of images are for a range of 60 m; here they are {scale:.3g} times as large."]
    truths = dict.fromkeys(row["colour_truth"] for row in results if "colour_truth" in row)
    lines += [f"True colours are those of {truth}." for truth in truths]
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(measured: Sequence[Mapping[str, Any]], costs: tuple[str, ...]) -> list[str]:
    """Return a table's lines; it has a column for each of its costs, and for each error that one of its rows has."""
    errors = [name for name in ROW_TITLES if any(name in row["errors"] for row in measured)]
    shares = [name for name in costs if name in _SHARES and any(name in row["shares"] for row in measured)]
    plain = [name for name in costs if name in _COSTS]
    titles = ["knob", "value", *(_COSTS[name][0] for name in plain), *(f"{name} (%)" for name in shares)]
    titles += [ROW_TITLES[name] for name in errors]
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for row in measured:
        cells = [row["knob"], str(row["value"])]
        cells += ["-" if row[name] is None else format(row[name], _COSTS[name][1]) for name in plain]
        cells += [f"{100.0 * row['shares'].get(name, 0.0):.2f}" for name in shares]
        cells += [f"{row['errors'][name]:.3g}" if name in row["errors"] else "-" for name in errors]
        lines.append("| " + " | ".join(cells) + " |")
    return lines
