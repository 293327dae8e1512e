"""The knobs that trade speed for accuracy, the values that they are measured at, and the tables of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

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
    scale = image_scale(load_scenario(scenario).scan.platform.typical_range() or USUAL_RANGE)
    base = () if KNOBS[knob].table == "presets" else ("fidelity=standard",)
    return load_scenario(
        scenario, [*base, *changes, *(_scale_change(change, scale) for change in KNOBS[knob].rows[value])]
    )


def _scale_change(change: str, scale: float) -> str:
    path, _, value = change.partition("=")
    return f"{path}={float(value) * scale:g}" if path in _LENGTHS_OF_IMAGES else change
