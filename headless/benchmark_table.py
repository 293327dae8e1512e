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
    "seconds": Limit("demo job in all", "s", 120.0, True, 1),
    "memory_mb": Limit("demo job, memory", "MB", 3000.0, True, 0),
    "parameters": Limit("parameters", "s", 1.0, True),
    "model": Limit("model", "s", 8.0, True),
    "panel_edit": Limit("panel edit to updated view", "s", 0.2, True, 3),
    "casting": Limit("casting and radiometry, of the bare caster's rate", "%", 60.0, False, 0),
    "writing": Limit("writing LAZ", "million points/s", 3.0, False),
    "waves_pulses": Limit("waves, 1 ray per pulse", "million pulses/s", 1.6, False),
    "waves_rays": Limit("waves, 19 rays per pulse", "million rays/s", 2.55, False),
    "waves_memory": Limit("waves, memory", "B/triangle", 500.0, True, 0),
    "waves_opening": Limit("waves, opening", "s", 4.2, True),
}
"""Lines by name."""


def markdown(result: dict[str, Any]) -> str:
    """Return a benchmark's result as Markdown: tables of limits, stages, and rates beside bare libraries."""
    lines = [f"Machine: {result['machine']}", ""]
    if result["quick"]:
        lines += ["A quick run on a small scene: it shows that all works, and nothing of the speed.", ""]
    return "\n".join([*lines, *_limits(result), "", *_stages(result), "", *_floors(result)]) + "\n"


def judge_lines(result: dict[str, Any]) -> Iterator[tuple[str, float, bool]]:
    """Yield (name, value, whether its limit is kept) for each line measured on as many cores as limits are for."""
    run = next((run for run in result["runs"] if run["cores"] == CORES), None)
    for name, limit in LIMITS.items():
        value = (run or {}).get("lines", {}).get(name)
        if value is not None:
            yield name, value, limit.is_kept_by(value)


def _limits(result: dict[str, Any]) -> list[str]:
    runs = result["runs"]
    titles = ["", *(f"{run['cores']} core{'s' * (run['cores'] > 1)}" for run in runs), "limit", f"on {CORES} cores"]
    kept = {} if result["quick"] else {name: good for name, _, good in judge_lines(result)}
    rows = []
    for name, limit in LIMITS.items():
        values = [_number(run["lines"].get(name), limit.digits) for run in runs]
        bound = f"{'at most' if limit.most else 'at least'} {limit.limit:g} {limit.unit}"
        verdict = {True: "kept", False: "**missed**", None: "–"}[kept.get(name)]
        rows.append([limit.title, *values, bound, verdict])
    return markdown_table(titles, rows)


def _stages(result: dict[str, Any]) -> list[str]:
    runs = result["runs"]
    rows = []
    for name in runs[0]["stages"]:
        seconds = [_number(run["stages"][name]["seconds"], 2) for run in runs]
        rows.append([name, *seconds, _number(runs[-1]["stages"][name]["peak_memory_mb"], 0)])
    return markdown_table(["stage of the demo job (s)", *(str(run["cores"]) for run in runs), "peak memory (MB)"], rows)


def _floors(result: dict[str, Any]) -> list[str]:
    rows = []
    for run in result["runs"]:
        for floor in run["floors"]:
            share = 100.0 * floor["ours"] / floor["floor"]
            values = [_number(floor[side], 2) for side in ("ours", "floor")]
            rows.append([floor["name"], str(run["cores"]), floor["unit"], *values, f"{share:.0f}"])
    return markdown_table(["beside its floor", "cores", "unit", "ours", "floor", "ours of the floor (%)"], rows)


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:,.{digits}f}"
