"""The tables of the trade-off: costs and errors of each row, and which presets lie on the front."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from synthroads_addon.base.schema import is_number
from synthroads_addon.base.text.table import markdown_table
from synthroads_addon.jobs.measure.tradeoff import ALIKE, KNOBS
from synthroads_addon.scenario.colour import USUAL_RANGE, image_scale
from synthroads_addon.scenario.scenario import load_scenario

ROW_TITLES = {
    "height_mm": "road height, largest error (mm)",
    "position_mm": "hit position, 95 % (mm)",
    "intensity_percent": "intensity, 95 % (%)",
    "labels_percent": "points of another class (%)",
    "density_percent": "missing points (%)",
    "relief_mm": "micro-relief, 95 % (mm)",
    "colour_median": "colour, CIEDE2000 median",
    "colour_95": "colour, CIEDE2000 95 %",
    "layers_rmse": "material layers, RMSE",
}
"""Errors against truth and how they are measured: see `jobs.measure.rows`."""

_COSTS = {
    "seconds": ("processor time (s)", ".1f"),
    "model_seconds": ("of which model (s)", ".1f"),
    "image_seconds": ("of which images (s)", ".1f"),
    "peak_memory_mb": ("memory (MB)", ".0f"),
    "triangles": ("triangles", ",d"),
    "rays_per_second": ("rays/s", ",d"),
    "images": ("images", "d"),
    "megapixels": ("Mpx", ".1f"),
}
_SHARES = ("image", "next image", "nearby", "material", "nodes", "return")

TABLES: dict[str, tuple[str, ...]] = {
    "model and beam": ("seconds", "model_seconds", "peak_memory_mb", "triangles", "rays_per_second"),
    "points": ("seconds", "peak_memory_mb"),
    "colours": ("seconds", "image_seconds", "peak_memory_mb", "images", "megapixels", *_SHARES),
    "kernels": ("seconds", "image_seconds", "peak_memory_mb", "rays_per_second"),
    "light": ("seconds", "image_seconds", "peak_memory_mb"),
    "presets": ("seconds", "model_seconds", "image_seconds", "peak_memory_mb", "triangles"),
}
"""Table -> the columns of costs that it has, before those of the errors."""


def row_fault(row: Any, knob: str, value: Any) -> str | None:
    """Return what keeps a row that was read from a file out of the tables, or None if it is one of this knob and value.

    Args:
        row: as JSON data; one of `jobs.measure.rows.measure_row`, perhaps repeated.
        knob, value: that it is of.
    """
    if not isinstance(row, dict) or (row.get("knob"), row.get("value")) != (knob, value):
        return f"must be an object with the knob {knob} and the value {value}"
    numbers = {name: form.endswith("d") for name, (_, form) in _COSTS.items() if name in TABLES[KNOBS[knob].table]}
    for name, is_whole in numbers.items():
        cost = row.get(name, "")
        is_unknown = cost is None and name != "seconds"
        if not is_unknown and not (is_number(cost) and cost >= 0.0 and not (is_whole and isinstance(cost, float))):
            return f"{name} must be a {'whole ' if is_whole else ''}number from 0"
    for name, names in (("errors", tuple(ROW_TITLES)), ("shares", _SHARES)):
        part = row.get(name, {} if name == "shares" else None)
        if not isinstance(part, dict) or not all(key in names and is_number(part[key]) for key in part):
            return f"{name} must be numbers by name: {', '.join(names)}"
    all_seconds = row.get("all_seconds", [1.0])
    if not isinstance(all_seconds, list) or not all(is_number(number) and number > 0.0 for number in all_seconds):
        return "all_seconds must be a list of numbers above 0"
    faulty_field = next((name for name in ("machine", "colour_truth") if not isinstance(row.get(name, ""), str)), None)
    return faulty_field and f"{faulty_field} must be a text"


def measured_rows(results: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the rows without those that couldn't be measured in this Blender."""
    return [row for row in results if "left_out" not in row]


def time_noise(results: Iterable[Mapping[str, Any]]) -> float | None:
    """Return the largest relative spread of the seconds of repeated rows, (max - min) / mean; None without any.

    The largest such spread of the rows that were measured `REPEATED` times; None if there is none.
    """
    times_of_rows = [row["all_seconds"] for row in measured_rows(results) if len(row.get("all_seconds", ())) > 1]
    return max(((max(times) - min(times)) * len(times) / sum(times) for times in times_of_rows), default=None)


def better_row(row: Mapping[str, Any], others: Iterable[Mapping[str, Any]], noise: float) -> Mapping[str, Any] | None:
    """Return the fastest row that beats `row` in time beyond the noise and is as accurate in all errors, or None.

    Errors count as equal up to `ALIKE`. The fastest such row; None if there is none, so that `row` lies on the front.
    """

    def as_accurate(other: Mapping[str, Any]) -> bool:
        """Return whether another row has all errors of the row, and none that is larger."""
        other_errors = other["errors"]
        return all(
            name in other_errors and abs(other_errors[name]) <= (1.0 + ALIKE) * abs(error)
            for name, error in row["errors"].items()
        )

    faster_rows = [
        other for other in others if other["seconds"] < row["seconds"] * (1.0 - noise) and as_accurate(other)
    ]
    return min(faster_rows, key=lambda other: other["seconds"], default=None)


def front_lines(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a Markdown table of which presets lie on the Pareto front; empty without presets."""
    job_rows = [row for row in measured_rows(results) if KNOBS[row["knob"]].table == "presets"]
    presets = [row for row in job_rows if row["knob"] == "fidelity"]
    if not presets:
        return []
    noise = time_noise(results)
    rows = []
    for row in presets:
        other = better_row(row, [job_row for job_row in job_rows if job_row is not row], noise or 0.0)
        faster_row = "-" if other is None else f"{other['value']}: {other['seconds']:.1f} s for {row['seconds']:.1f} s"
        rows.append([str(row["value"]), "yes" if other is None else "no", faster_row])
    lines = markdown_table(["preset", "on the front", "faster, and as accurate in all errors"], rows)
    text = "No settings were measured twice, so every difference of time counts."
    if noise is not None:
        text = (
            f"Two runs with the same settings differ in time by up to {100.0 * noise:.0f} %; "
            "only rows that are faster by more than this count as faster."
        )
    alike_text = f"Errors that are larger by less than {100.0 * ALIKE:.0f} % count as equal."
    others = f"Each preset is compared with {len(job_rows) - 1} other rows of the same job."
    return [*lines, "", f"{others} {alike_text} {text}"]


def markdown(results: Sequence[Mapping[str, Any]], scenario: str) -> str:
    """Return rows of `jobs.measure.rows.measure_row` as Markdown tables, with the reasons for rows left out."""
    return "\n".join(table_texts(results, scenario).values())


def table_texts(results: Sequence[Mapping[str, Any]], scenario: str) -> dict[str, str]:
    """Return the Markdown of each of `TABLES` that has rows, by name, with the command and the machine."""
    texts = {table: _table_text(results, table, scenario) for table in TABLES}
    return {table: text for table, text in texts.items() if text}


def _table_text(results: Sequence[Mapping[str, Any]], table: str, scenario: str) -> str:
    """Return the Markdown of one table; empty if no row is in it."""
    rows = [row for row in results if KNOBS[row["knob"]].table == table]
    if not rows:
        return ""
    machines = dict.fromkeys(row["machine"] for row in rows if "machine" in row)
    knobs = " ".join(dict.fromkeys(row["knob"] for row in rows))
    command = f"`synthroads tradeoff --scenario {scenario} --knobs {knobs} --output DIR`"
    lines = [f"{table.capitalize()}: {'; '.join([command, *machines])}", ""]
    if measured := measured_rows(rows):
        lines += [*_table(measured, TABLES[table]), ""]
    left_out = [f"- {row['knob']} {row['value']}: {row['left_out']}" for row in rows if "left_out" in row]
    lines += [*left_out, ""] if left_out else []
    if table == "presets":
        front = front_lines(results)
        lines += [*front, ""] if front else []
    scale = image_scale(load_scenario(scenario).scan.platform.typical_range() or USUAL_RANGE)
    if scale != 1.0 and table == "colours":
        lines += [f"Spacings and pixels of images are for a range of 60 m; here they are {scale:.3g} times as large."]
    truths = dict.fromkeys(row["colour_truth"] for row in rows if "colour_truth" in row)
    lines += [f"True colours are those of {truth}." for truth in truths]
    return "\n".join(lines).rstrip("\n") + "\n"


def _table(rows_with_figures: Sequence[Mapping[str, Any]], costs: tuple[str, ...]) -> list[str]:
    """Return the lines of a Markdown table of rows, with columns for costs and for each error that a row has."""
    errors = [name for name in ROW_TITLES if any(name in row["errors"] for row in rows_with_figures)]
    shares = [name for name in costs if name in _SHARES and any(name in row["shares"] for row in rows_with_figures)]
    plain_costs = [name for name in costs if name in _COSTS]
    titles = ["knob", "value", *(_COSTS[name][0] for name in plain_costs), *(f"{name} (%)" for name in shares)]
    titles += [ROW_TITLES[name] for name in errors]
    rows = []
    for row in rows_with_figures:
        cells = [row["knob"], str(row["value"])]
        cells += ["-" if row[name] is None else format(row[name], _COSTS[name][1]) for name in plain_costs]
        cells += [f"{100.0 * row['shares'].get(name, 0.0):.2f}" for name in shares]
        cells += [f"{row['errors'][name]:.3g}" if name in row["errors"] else "-" for name in errors]
        rows.append(cells)
    return markdown_table(titles, rows)
