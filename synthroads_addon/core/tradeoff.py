"""The knobs that trade speed for accuracy, the values that they are measured at, and the table of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

KNOBS: dict[str, tuple[Any, ...]] = {
    "geometric_tolerance": (0.02, 0.01, 0.005, 0.002, 0.001),
    "caster": ("bvhtree", "embree"),
    "rays_per_pulse": (1, 7, 19, 37, 61),
    "fidelity": ("draft", "standard", "high"),
}
"""Knob -> values. ``fidelity`` are the presets: points that set several knobs at once."""

ROW_TITLES = {
    "height_mm": "road height, largest error (mm)",
    "position_mm": "hit position, 95 % (mm)",
    "intensity_percent": "intensity, 95 % (%)",
    "labels_percent": "points of another class (%)",
}
"""Errors against truth and how they are measured: see `measuring`."""


def rows(knobs: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Yield (knob, value) of every row."""
    for knob in knobs:
        for value in KNOBS[knob]:
            yield knob, value


def markdown(results: list[dict[str, Any]], scenario: str) -> str:
    """Return the table; columns are time, memory, triangles, rays per second and the errors."""
    titles = ["knob", "value", "processor time (s)", "of it model (s)", "memory (MB)", "triangles", "rays/s"]
    titles += ROW_TITLES.values()
    lines = [f"Scene `{scenario}`: `synthroads tradeoff --scenario {scenario} --output DIR`", ""]
    lines += ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for row in results:
        cells = [row["knob"], str(row["value"]), f"{row['seconds']:.1f}", f"{row['model_seconds']:.1f}"]
        cells += [f"{row['peak_memory_mb'] or 0:.0f}", f"{row['triangles']:,}", f"{row['rays_per_second']:,.0f}"]
        cells += [f"{row['errors'][name]:.3g}" for name in ROW_TITLES]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
