"""The plot of the trade-off: error against time, one panel per kind of error."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from headless.tradeoff_table import ROW_TITLES, measured_rows
from synthroads_addon.base.figure import new_figure, save_figure
from synthroads_addon.base.text.literal import literal_texts, shown_text
from synthroads_addon.jobs.measure.tradeoff import KNOBS

Row = Mapping[str, Any]
_ORDER = list(KNOBS)
_DECADES = 30.0
"""An error that spans more than this is drawn on a logarithmic axis."""


@literal_texts()
def plot(results: Sequence[Row], path: Path) -> None:
    """Draw rows as errors against seconds into an image file, one panel per kind of error; presets are stars."""
    rows = measured_rows(results)
    panels = [name for name in ROW_TITLES if any(_varies(rows, knob, name) for knob in _knobs(rows))]
    columns = min(3, max(1, len(panels)))
    lines = -(-max(1, len(panels)) // columns)
    figure = new_figure(5.2 * columns, 3.9 * lines + 0.6)
    axes = figure.subplots(lines, columns, squeeze=False)
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    handles: dict[str, Any] = {}
    for axis, name in zip(axes.flat, panels, strict=False):
        for knob in sorted(_knobs(rows), key=_ORDER.index):
            if _varies(rows, knob, name):
                handles[_label(knob)] = _draw_knob(axis, [row for row in rows if row["knob"] == knob], knob, name)
        _set_scales(axis, [abs(row["errors"][name]) for row in rows if name in row["errors"]])
        axis.set(xlabel="processor time of the whole job (s)", ylabel=ROW_TITLES[name])
        axis.grid(alpha=0.3)
    if handles:
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    save_figure(figure, path, dpi=90)


def _set_scales(axis: Any, errors: Sequence[float]) -> None:
    """Set an axis to logarithmic time, and to a symmetric-log error scale where errors span decades."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.margins(x=0.12)
    largest = max(errors, default=0.0) or 1.0
    if _spans_decades(errors):
        smallest = min(value for value in errors if value > 0.0)
        axis.set_yscale("symlog", linthresh=smallest)
        axis.yaxis.set_major_formatter("{x:g}")
        axis.set_ylim(-0.7 * smallest, 2.0 * largest)
    else:
        axis.set_ylim(-0.1 * largest, 1.12 * largest)


def _label(knob: str) -> str:
    """Return the name of a knob in the legend."""
    return {"between": "presets with one knob of another", "fidelity": "presets"}.get(knob, knob.replace("_", " "))


def _knobs(rows: Sequence[Row]) -> list[str]:
    """Return the knobs of rows, each once, in their order."""
    return list(dict.fromkeys(row["knob"] for row in rows))


def _whole_job(knob: str) -> bool:
    """Return whether a knob's rows are whole jobs: presets and what lies between them."""
    return KNOBS[knob].table == "presets"


def _varies(rows: Sequence[Row], knob: str, name: str) -> bool:
    """Return whether a knob changes a kind of error visibly; presets always count if they have the error."""
    errors = [abs(row["errors"][name]) for row in rows if row["knob"] == knob and name in row["errors"]]
    if _whole_job(knob):
        return bool(errors)
    all_errors = [abs(row["errors"][name]) for row in rows if name in row["errors"]]
    if not errors or (not _spans_decades(all_errors) and max(errors) < 0.05 * max(all_errors)):
        return False
    return max(errors) - min(errors) > 0.5 * max(errors)


def _spans_decades(errors: Sequence[float]) -> bool:
    """Return whether errors differ so much that they need a logarithmic axis."""
    positive_errors = [value for value in errors if value > 0.0]
    return bool(positive_errors) and max(positive_errors) > _DECADES * min(positive_errors)


def _draw_knob(axis: Any, rows_of_knob: Sequence[Row], knob: str, name: str) -> Any:
    """Draw a knob's rows as labelled points, joined by a line unless they are presets; return the plot handle."""
    is_preset = knob == "fidelity"
    style = "*" if is_preset else "x" if _whole_job(knob) else "o-"
    colour = "black" if is_preset else "0.55" if _whole_job(knob) else f"C{_ORDER.index(knob) % 10}"
    x, y = [row["seconds"] for row in rows_of_knob], [abs(row["errors"][name]) for row in rows_of_knob]
    (handle,) = axis.plot(x, y, style, color=colour, markersize=13 if is_preset else 5, zorder=3 if is_preset else 2)
    if knob == "between":
        return handle
    for row, a, b in zip(rows_of_knob, x, y, strict=True):
        place = (7, 7) if is_preset else (4, 4 if b > 0.0 else -11)
        look: dict[str, Any] = {"fontsize": 8, "color": colour, "weight": "bold" if is_preset else "normal"}
        axis.annotate(shown_text(str(row["value"])), (a, b), textcoords="offset points", xytext=place, **look)
    return handle
