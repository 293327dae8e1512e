"""The plot of the trade-off: error against time, one panel per kind of error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.tradeoff import KNOBS, ROW_TITLES, measured_of

Row = Mapping[str, Any]


def plot(results: Sequence[Row], path: Path) -> None:
    """Draw error against time; the rows of one knob are joined, the presets are stars.

    Raises:
        InputError: matplotlib is missing.
    """
    try:
        import matplotlib as mpl
    except ImportError:
        raise InputError("tradeoff", None, "needs matplotlib for its plot: pip install matplotlib") from None
    mpl.use("Agg")
    from matplotlib import pyplot

    measured = measured_of(results)
    panels = [name for name in ROW_TITLES if any(_varies(measured, knob, name) for knob in _knobs(measured))]
    columns = min(3, max(1, len(panels)))
    lines = -(-max(1, len(panels)) // columns)
    figure, axes = pyplot.subplots(lines, columns, figsize=(5.2 * columns, 4.2 * lines), squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, panels, strict=False):
        for knob in _knobs(measured):
            if _varies(measured, knob, name):
                _draw_knob(axis, [row for row in measured if row["knob"] == knob], knob, name)
        axis.set(xlabel="processor time of the whole job (s)", ylabel=ROW_TITLES[name], xscale="log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("{x:g}")
        axis.tick_params(axis="x", which="both", labelsize=7, rotation=45)
        axis.set_ylim(0, 1.15 * axis.get_ylim()[1])
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)


def _knobs(measured: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["knob"] for row in measured))


def _whole_job(knob: str) -> bool:
    return KNOBS[knob].table == "presets"


def _varies(measured: Sequence[Row], knob: str, name: str) -> bool:
    """Return whether a knob changes a kind of error at all: a flat line says nothing."""
    errors = [row["errors"][name] for row in measured if row["knob"] == knob and name in row["errors"]]
    if _whole_job(knob):
        return bool(errors)
    largest = max(abs(row["errors"].get(name, 0.0)) for row in measured)
    if not errors or max(map(abs, errors)) < 0.05 * largest:
        return False
    return max(errors) - min(errors) > 0.5 * max(map(abs, errors))


def _draw_knob(axis: Any, rows_of_knob: Sequence[Row], knob: str, name: str) -> None:
    preset = knob == "fidelity"
    style = "*" if preset else "x" if _whole_job(knob) else "o-"
    x, y = [row["seconds"] for row in rows_of_knob], [row["errors"][name] for row in rows_of_knob]
    label = "presets with one knob of another" if knob == "between" else knob.replace("_", " ")
    axis.plot(x, y, style, label=label, markersize=14 if preset else 6)
    for row, a, b in zip(rows_of_knob, x, y, strict=True):
        if knob != "between":
            place = (8, -14 if preset else 5)
            axis.annotate(str(row["value"]), (a, b), textcoords="offset points", xytext=place, fontsize=8)
