"""Lines of `synthroads benchmark`, the limits that they are held against, and the tables."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from synthroads_addon.base.text.table import markdown_table

TABLE = "benchmark"
"""Name of the tables in a document."""
CORES = 2
"""Cores that the limits are for."""

DEMO = (
    "scan.platform.speed=4.4",
    'cloud.attributes=["range","incidence","normal","roughness","metallic","specular"]',
    'outputs=["parameters","cloud"]',
)
"""Changes of the demo's scenario: more than 15 million points, with everything that a point can have."""
QUICK = ("road.length=60", "fidelity=draft", "scan.platform.speed=8", "colour.ground_sampling_distance=0.5")
"""Further changes, with which it takes seconds: to see that all works, not how fast."""


@dataclass(frozen=True)
class Limit:
    """A bound that a measured figure of the benchmark must keep.

    Attributes:
        title: what is measured.
        unit: of the limit and the value.
        limit: that it must keep.
        most: whether the value must not be larger; else it must not be smaller.
        digits: of the value as it is shown.
    """

    title: str
    unit: str
    limit: float
    most: bool
    digits: int = 2

    def is_kept_by(self, value: float) -> bool:
        """Return whether a value keeps the limit, which is an upper or a lower bound."""
        return value <= self.limit if self.most else value >= self.limit


LIMITS = {
    "points": Limit("points of the demo job", "million", 15.0, False, 1),
    "memory_mb": Limit("demo job, memory", "MB", 3000.0, True, 0),
    "job": Limit("demo job in all; Embree and lazrs alone for its rays and points", "times", 7.0, True, 1),
    "model": Limit("parameters, model and scene mesh; Blender alone for as many triangles", "times", 4.0, True, 1),
    "panel_edit": Limit("panel edit to updated view; Blender alone for as many triangles", "times", 8.0, True, 1),
    "casting": Limit("casting and radiometry; Embree alone", "%", 60.0, False, 0),
    "writing": Limit("writing LAZ; lazrs alone", "%", 80.0, False, 0),
    "rendering": Limit("rendering, all layers; Cycles, the picture alone", "%", 80.0, False, 0),
    "waves_1": Limit("waves, 1 ray per pulse; Embree alone", "%", 20.0, False, 0),
    "waves_19": Limit("waves, 19 rays per pulse; Embree alone", "%", 40.0, False, 0),
    "waves_memory": Limit("waves, memory", "B/triangle", 500.0, True, 0),
    "waves_opening": Limit("waves, opening; Blender's importer alone", "times", 3.0, True, 1),
    "waves_fixed": Limit("waves, what a scan takes besides its pulses, processor time", "s", 0.08, True),
    "road_1": Limit("road, 1 ray per pulse; Embree alone", "%", 10.0, False, 0),
    "road_7": Limit("road, 7 rays per pulse; Embree alone", "%", 25.0, False, 0),
    "road_19": Limit("road, 19 rays per pulse; Embree alone", "%", 33.0, False, 0),
    "scaling": Limit("two cores against one, by the clock; the least of all scans of meshes", "times", 1.9, False),
    "waves_1_beside": Limit("waves, 1 ray per pulse; the other version", "times", 1.0, False),
    "waves_19_beside": Limit("waves, 19 rays per pulse; the other version", "times", 1.0, False),
    "road_1_beside": Limit("road, 1 ray per pulse; the other version", "times", 1.0, False),
    "road_7_beside": Limit("road, 7 rays per pulse; the other version", "times", 1.0, False),
    "road_19_beside": Limit("road, 19 rays per pulse; the other version", "times", 1.0, False),
    "start_beside": Limit("first scan of a new process, its processor time; the other version", "times", 1.0, True),
    "memory_beside": Limit("memory of a scan, the worst of these; the other version", "times", 1.0, True),
}
"""Lines by name. Whatever measures speed is held against another's code that does the same in the same run: as many
times its time, or so much of its rate."""
_PROCESSOR_RATE = "million pulses per processor second"


def beside_lines(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return the lines of scans that were measured beside another version, see `headless.benchmark`.

    Args:
        rows: ``name``, and ``ours`` and ``other``, each with ``scan``, ``whole``, ``pulses`` and ``memory_mb``.
    """
    lines = {}
    for row in rows:
        ours, other = row["ours"], row["other"]
        if row["name"] == "start":
            lines["start_beside"] = ours["whole"] / other["whole"]
        else:
            lines[f"{row['name']}_beside"] = _pulse_rate(ours) / _pulse_rate(other)
    if rows:
        lines["memory_beside"] = max(row["ours"]["memory_mb"] / max(row["other"]["memory_mb"], 1.0) for row in rows)
    return lines


def _pulse_rate(figures: dict[str, Any]) -> float:
    """Return a scan's rate, million pulses per processor second."""
    return float(figures["pulses"]) / figures["scan"] / 1e6


def join_runs(runs_before: list[dict[str, Any]], new_runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return runs by cores in which what was measured now takes the place of what was kept under the same names."""
    run_of_cores = {run["cores"]: run for run in runs_before}
    for run in new_runs:
        run_before = run_of_cores.get(run["cores"], {})
        parts = {name: run_before.get(name, {}) | run[name] for name in ("lines", "stages", "scans")}
        rows = {name: _join_rows(run_before.get(name, []), run[name]) for name in ("floors", "beside")}
        run_of_cores[run["cores"]] = {"cores": run["cores"]} | parts | rows
    return [run_of_cores[cores] for cores in sorted(run_of_cores)]


def _join_rows(rows_before: list[dict[str, Any]], new_rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rows in which new ones take the place of earlier ones of the same name."""
    return list(({row["name"]: row for row in rows_before} | {row["name"]: row for row in new_rows}).values())


def add_scaling(runs: list[dict[str, Any]]) -> None:
    """Add to the run on `CORES` cores how much faster its slowest-growing scan of a mesh is than on one, in place."""
    by_cores = {run["cores"]: run for run in runs}
    if {1, CORES} <= by_cores.keys():
        scans_on_one, scans_on_more = by_cores[1]["scans"], by_cores[CORES]["scans"]
        names = scans_on_one.keys() & scans_on_more.keys()
        gains = [scans_on_more[name]["pulses_per_second"] / scans_on_one[name]["pulses_per_second"] for name in names]
        if gains:
            by_cores[CORES]["lines"]["scaling"] = min(gains)


def markdown(result: dict[str, Any]) -> str:
    """Return a benchmark's result as Markdown: tables of limits, stages, and rates beside bare libraries."""
    lines = [f"Machine: {result['machine']}", ""]
    if result["quick"]:
        lines += ["A quick run on a small scene: it shows that all works, and nothing of the speed.", ""]
    tables = [_limits(result), _stages(result), _floors(result), _cores(result), _beside(result)]
    return "\n\n".join(["\n".join([*lines, *tables[0]]), *("\n".join(table) for table in tables[1:] if table)]) + "\n"


def judge_lines(result: dict[str, Any]) -> Iterator[tuple[str, float, bool]]:
    """Yield (name, value, whether its limit is kept) for each line measured on as many cores as limits are for."""
    run = next((run for run in result["runs"] if run["cores"] == CORES), None)
    for name, limit in LIMITS.items():
        value = (run or {}).get("lines", {}).get(name)
        if value is not None:
            yield name, value, limit.is_kept_by(value)


def _limits(result: dict[str, Any]) -> list[str]:
    """Return the table of the lines with their limits, and whether they are kept."""
    runs = result["runs"]
    titles = ["", *(f"{run['cores']} core{'s' * (run['cores'] > 1)}" for run in runs), "limit", f"on {CORES} cores"]
    verdicts = {} if result["quick"] else {name: is_kept for name, _, is_kept in judge_lines(result)}
    rows = []
    for name, limit in LIMITS.items():
        values = [_number(run["lines"].get(name), limit.digits) for run in runs]
        bound = f"{'at most' if limit.most else 'at least'} {limit.limit:g} {limit.unit}"
        verdict = {True: "kept", False: "**missed**", None: "–"}[verdicts.get(name)]
        rows.append([limit.title, *values, bound, verdict])
    return markdown_table(titles, rows)


def _stages(result: dict[str, Any]) -> list[str]:
    """Return the table of the demo job's stages: seconds by number of cores, and memory."""
    runs = result["runs"]
    rows = []
    for name in max((run["stages"] for run in runs), key=len):
        stages_by_run = [run["stages"].get(name, {}) for run in runs]
        memory = next((stage["peak_memory_mb"] for stage in reversed(stages_by_run) if stage), None)
        rows.append([name, *(_number(stage.get("seconds"), 2) for stage in stages_by_run), _number(memory, 0)])
    titles = ["stage of the demo job (s)", *(str(run["cores"]) for run in runs), "peak memory (MB)"]
    return markdown_table(titles, rows) if rows else []


def _floors(result: dict[str, Any]) -> list[str]:
    """Return the table of rates beside their floors: the rates of bare libraries at the same work."""
    rows = []
    for run in result["runs"]:
        for measurement in run["floors"]:
            percent = 100.0 * measurement["ours"] / measurement["floor"]
            values = [_number(measurement[side], 2) for side in ("ours", "floor")]
            rows.append([measurement["name"], str(run["cores"]), measurement["unit"], *values, f"{percent:.0f}"])
    titles = ["beside its floor", "cores", "unit", "ours", "floor", "ours of the floor (%)"]
    return markdown_table(titles, rows) if rows else []


def _cores(result: dict[str, Any]) -> list[str]:
    """Return the table of scans of meshes by the cores that they may use."""
    rows = []
    for name in max((run["scans"] for run in result["runs"]), key=len):
        runs = [run for run in result["runs"] if name in run["scans"]]
        first_scan = runs[0]["scans"][name]
        for run in runs:
            scan = run["scans"][name]
            gain = scan["pulses_per_second"] / first_scan["pulses_per_second"]
            growth = first_scan["processor_rate"] / scan["processor_rate"]
            cells = [_number(value, 2) for value in (scan["pulses_per_second"], gain, growth)]
            rows.append([_scan_title(name), str(run["cores"]), *cells, f"{100.0 * scan['busy']:.0f}"])
    titles = ["scan", "cores", "million pulses/s", "times as fast", "processor time, times", "cores busy (%)"]
    return markdown_table(titles, rows) if rows else []


def _beside(result: dict[str, Any]) -> list[str]:
    """Return the table of scans that both versions did."""
    rows = []
    for run in result["runs"]:
        for row in run["beside"]:
            ours, other = row["ours"], row["other"]
            is_start = row["name"] == "start"
            cells = [figures["whole"] if is_start else _pulse_rate(figures) for figures in (ours, other)]
            memory = [_number(figures["memory_mb"], 0) for figures in (ours, other)]
            unit = "processor seconds" if is_start else _PROCESSOR_RATE
            title = "first scan of a new process" if is_start else _scan_title(row["name"])
            rows.append([title, str(run["cores"]), unit, *(_number(cell, 2) for cell in cells), *memory])
    titles = ["beside another version", "cores", "unit", "ours", "the other's", "memory (MB)", "the other's"]
    return markdown_table(titles, rows) if rows else []


def _scan_title(name: str) -> str:
    """Return the name of a scan of a mesh in words, ``waves_19``: waves, 19 rays per pulse."""
    scene, _, rays = name.partition("_")
    return f"{scene}, {rays} {'ray' if rays == '1' else 'rays'} per pulse"


def _number(value: float | None, digits: int) -> str:
    """Return a number with digits after its point, as text; a dash for None."""
    return "–" if value is None else f"{value:,.{digits}f}"
