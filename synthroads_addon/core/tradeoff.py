"""The knobs that trade speed for accuracy, the values that they are measured at, and the tables of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

BARE = ("colour.rgb=false", "scan.relief=0")
"""Changes that leave out what the knobs of the model and the beam don't touch."""
IMAGES = ("scan.relief=0", "colour.source=images")
WHOLE_PATHS = ("scan.relief=0", "colour.source=returns", "colour.lighting=path")
TRUE_SAMPLES = 256
"""Samples per pixel of the light that counts as true beside whole light paths."""
DENSEST = ("colour.image_spacing=15", "colour.ground_sampling_distance=0.06")
"""Changes that give the images that count as true where Blender has no pixel per return."""


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


KNOBS: dict[str, Knob] = {
    "geometric_tolerance": Knob(
        "model and beam", _field("geometric_tolerance", (0.02, 0.01, 0.005, 0.002, 0.001), BARE), ("height", "beam")
    ),
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
        ("height", "beam", "relief", "colour"),
    ),
}
"""Knobs by name. ``fidelity`` are the presets: points that set several knobs at once."""

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
"""Errors against truth and how they are measured: see `measuring`."""

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


def markdown(results: list[dict[str, Any]], scenario: str) -> str:
    """Return the tables of rows as `measuring.measure_row` gives them, and what was left out of them and why."""
    lines = [f"Scene `{scenario}`: `synthroads tradeoff --scenario {scenario} --output DIR`", ""]
    for table, costs in TABLES.items():
        own = [row for row in results if KNOBS[row["knob"]].table == table]
        measured = [row for row in own if "left_out" not in row]
        if measured:
            lines += [f"{table.capitalize()}:", "", *_table(measured, costs), ""]
        left_out = [f"- {row['knob']} {row['value']}: {row['left_out']}" for row in own if "left_out" in row]
        lines += [*left_out, ""] if left_out else []
    truths = dict.fromkeys(row["colour_truth"] for row in results if "colour_truth" in row)
    lines += [f"True colours are those of {truth}." for truth in truths]
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(measured: list[dict[str, Any]], costs: tuple[str, ...]) -> list[str]:
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
