"""The knobs that trade speed for accuracy, the values that they are measured at, and the tables of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from ...base.files import PRESETS
from ...base.schema import read_json
from ...scenario.colour import USUAL_RANGE, image_scale
from ...scenario.scenario import Scenario, load_scenario

SCENES = ("rq31-600m-even", "mobile-mapping-300m-even", "airborne-1000m-even")
"""Built-in scenarios that the trade-off is measured on: 60 m above the road, on it, and 700 m above it."""
TRUE_SAMPLES = 256
"""Samples per pixel of the light that counts as true beside whole light paths."""
REPEATED = {"fidelity": 2}
"""Knobs whose rows are measured several times; the least time counts, and they say how far times scatter."""
ALIKE = 0.05
"""Errors count as equal up to this share: they are of stretches, and plants on another mesh stand elsewhere."""
_LENGTHS_OF_IMAGES = ("colour.image_spacing", "colour.ground_sampling_distance")


@dataclass(frozen=True)
class Knob:
    """A setting that trades speed for accuracy, the values it is measured at, and the errors measured.

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


def _read_knob(table: str, errors: list[str], always: list[str], rows: list[Any], whole_paths: bool = False) -> Knob:
    """Return a `Knob` from its entry in the shipped file, whose keys the parameters are.

    Args:
        table, errors, whole_paths: see `Knob`.
        always: changes that apply to every row.
        rows: pairs of a value and its changes.
    """
    return Knob(table, {value: (*always, *changes) for value, changes in rows}, tuple(errors), whole_paths)


KNOBS = {name: _read_knob(**data) for name, data in read_json(PRESETS / "tradeoff_rows.json").items()}
"""Knobs by name. ``fidelity`` are the presets: points that set several knobs at once; ``between`` are presets with one
knob of another, which a preset must not be worse than. What is usual in them: no colours and relief where the model and
the beam are measured, which don't touch these."""


def knob_rows(knobs: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Yield (knob, value) for every row of the trade-off's knobs."""
    for knob in knobs:
        for value in KNOBS[knob].rows:
            yield knob, value


def row_scenario(scenario: str, knob: str, value: Any, changes: Iterable[str] = ()) -> Scenario:
    """Return a row's scenario: a built-in one at standard fidelity, further changes, then those of the knob's value.

    What a knob doesn't change is as in the standard fidelity, so that its errors aren't drowned by those of a coarser
    one. Spacings and pixels of images are those for a range of 60 m, and farther apart and coarser from farther away.
    """
    scale = image_scale(load_scenario(scenario).scan.platform.typical_range() or USUAL_RANGE)
    base = () if KNOBS[knob].table == "presets" else ("fidelity=standard",)
    return load_scenario(
        scenario, [*base, *changes, *(_scale_change(change, scale) for change in KNOBS[knob].rows[value])]
    )


def _scale_change(change: str, scale: float) -> str:
    """Return a change ``path=value`` with the value scaled if it is a length that grows with the range."""
    path, _, value = change.partition("=")
    return f"{path}={float(value) * scale:g}" if path in _LENGTHS_OF_IMAGES else change
