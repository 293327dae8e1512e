"""Scores as Markdown: of the variants of an experiment, and of one network trained with several seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...results import Spread, defined

Scores = Mapping[str, Any]
"""Result of `Confusion.to_dict`."""
NOTE = "mean (standard deviation, ddof = 1) over seeds; - where undefined"


def by_test(results: Mapping[str, Mapping[str, Mapping[str, Scores]]], rows: Sequence[str] = ()) -> str:
    """Return for each test of an experiment a table: the IoU of each class and variant in percent.

    Args:
        results: variant -> seed -> test -> scores; variants without a seed are left out.
        rows: further rows, cells joined by ``|``, that the first test's table ends with.
    """
    done = {name: list(seeds.values()) for name, seeds in results.items() if seeds}
    lines = [f"IoU in %, {NOTE}.", ""]
    first = next(iter(done.values()))[0] if done else {}
    for place, (test, scores) in enumerate(first.items()):
        lines += [f"**{test}**", "", f"| class | points | {' | '.join(done)} |", "|---|--:|" + "--:|" * len(done)]
        for label, row in scores["classes"].items():
            cells = [percent([run[test]["classes"][label]["iou"] for run in runs]) for runs in done.values()]
            lines.append(f"| {label} | {row['support']:,} | {' | '.join(cells)} |")
        cells = [percent([run[test]["mean_iou"] for run in runs]) for runs in done.values()]
        lines.append(f"| mean | {scores['points']:,} | {' | '.join(cells)} |")
        lines += [*(rows if place == 0 else ()), ""]
    counts = ", ".join(f"{name} {len(runs)}" for name, runs in done.items())
    return "\n".join([*lines, f"Seeds: {counts}."])


def by_class(runs: Sequence[Scores]) -> str:
    """Return a table of precision, recall and IoU of each class that has points, in percent.

    Means stand below them where every class has points: what is predicted without occurring would count as 0.

    Args:
        runs: scores of one test, a run per seed.
    """
    lines = ["| class | points | precision | recall | IoU |", "|---|--:|--:|--:|--:|"]
    columns = ("precision", "recall", "iou")
    for label, row in runs[0]["classes"].items():
        if row["support"]:
            cells = [percent([run["classes"][label][column] for run in runs]) for column in columns]
            lines.append(f"| {label} | {row['support']:,} | {' | '.join(cells)} |")
    if all(row["support"] for row in runs[0]["classes"].values()):
        cells = [percent([run[f"mean_{column}"] for run in runs]) for column in columns]
        lines.append(f"| mean | {runs[0]['points']:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def percent(values: Sequence[float | None]) -> str:
    """Return shares as ``mean (standard deviation)`` in percent; None is undefined and left out."""
    return Spread.over([100.0 * value for value in defined(values)]).text(1, "-")


def cell(values: Sequence[float], decimals: int = 0) -> str:
    """Return numbers as ``mean (standard deviation)``, without the latter of a single one."""
    return Spread.over(defined(values)).text(decimals, "-")
