"""Certify recipes: how real their clouds are, as `synthroads compare` says, in one table and a file for each.

    synthroads dataset centerline-airborne --splits test --set road.length=200 --output out/centerline-airborne
    python tools/certify_recipes.py --real real.yaml --output docs/certificates out/centerline-airborne

Each folder is a data set that `synthroads dataset` has made, named as its recipe. Every cloud of it is compared with
all of the real ones. `docs/certificates/RECIPE.json` holds AUC, realism and statistics, `docs/certificates.md` the
table over all files in the folder, those of earlier runs included: recipes for other kinds of scanner are certified by
other real clouds.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.base.progress import exhaust  # noqa: E402
from synthroads_addon.base.schema import canonical_json  # noqa: E402
from synthroads_addon.comparison.job import CloudComparison, compare_steps  # noqa: E402
from synthroads_addon.dataset.recipe import load_recipe  # noqa: E402

_SHOWN = 3
_RANGE = 1.5
"""Statistics of a cloud count as real within this many times the range of the real clouds' ones, about its middle."""


def certificate(recipe: str, result: CloudComparison, real: str) -> dict[str, Any]:
    """Return a recipe's certificate as JSON data.

    Args:
        recipe: its name.
        result: of all its clouds.
        real: what the real clouds are, in words.
    """
    data = result.to_dict()
    auc = {group: _spread([row["auc"][group] for row in data["synthetic"]]) for group in data["realism"]}
    yardstick = {group: _spread([row["auc"][group] for row in data["real"]]) for group in data["realism"]}
    return {
        "type": "Certificate",
        "recipe": recipe,
        "title": load_recipe(recipe).title,
        "real": real,
        "clouds": len(data["synthetic"]),
        "patches": sum(row["patches"] for row in data["synthetic"]),
        "auc": auc,
        "yardstick": yardstick,
        "realism": data["realism"],
        "giveaways": dict(list(data["giveaways"].items())[:_SHOWN]),
        "statistics": _statistics(data),
    }


def _spread(values: list[float]) -> list[float]:
    """Return the least, the mean and the largest of some values."""
    return [round(float(value), 3) for value in (min(values), np.mean(values), max(values))]


def _statistics(data: dict[str, Any]) -> dict[str, Any]:
    """Return each statistic's medians, real and synthetic, and how many clouds lie within the real ones' range."""
    rows = {}
    for name in data["synthetic"][0]["medians"]:
        ours, theirs = ([row["medians"][name] for row in data[side]] for side in ("synthetic", "real"))
        middle, half = (max(theirs) + min(theirs)) / 2.0, _RANGE * (max(theirs) - min(theirs)) / 2.0
        inside = sum(abs(value - middle) <= half for value in ours)
        rows[name] = {"synthetic": _spread(ours), "real": _spread(theirs), "within": inside}
    return rows


def table(rows: list[dict[str, Any]], folder: str) -> str:
    """Return certificates as a Markdown page beside the folder that their files are in."""
    groups = list(rows[0]["realism"])
    lines = [
        "# How real are the recipes' clouds?",
        "",
        "AUC of telling each cloud from real ones (mean of all clouds), and in brackets realism: 1 - AUC over that of",
        "the real clouds among each other ([how it is measured](compare.md)). Statistics are within range where a",
        f"cloud's median lies within {_RANGE:g} times the range of the real clouds' medians. Made by",
        "",
        "    python tools/certify_recipes.py --real LIST --output docs/certificates DATASET ...",
        "",
        f"| recipe | clouds | {' | '.join(groups)} | statistics within range | tells most | against |",
        "|---|--:|" + "--:|" * len(groups) + "--:|---|---|",
    ]
    for row in rows:
        cells = [f"{row['auc'][group][1]:.2f} ({row['realism'][group]:.2f})" for group in groups]
        total = row["clouds"] * len(row["statistics"])
        within = sum(one["within"] for one in row["statistics"].values())
        told = ", ".join(f"{name} {told:.2f}" for name, (told, _) in row["giveaways"].items())
        name = f"[`{row['recipe']}`]({folder}/{row['recipe']}.json)"
        lines.append(
            f"| {name} | {row['clouds']} | {' | '.join(cells)} | {within} of {total} | {told} | {row['real']} |"
        )
    return "\n".join([*lines, ""])


def certify(folder: Path, real: Path, words: str) -> dict[str, Any]:
    """Compare the clouds of a data set with real ones; return its certificate.

    Raises:
        InputError: it holds no cloud, see also `compare_steps`.
    """
    clouds = folder / "scenes"
    if not clouds.is_dir():
        raise InputError(str(folder), None, "must be a data set that synthroads dataset has made")
    result = exhaust(compare_steps(clouds, real), lambda share: None)
    return certificate(folder.name, result, words)


def main() -> None:
    """Certify the command line's data sets: write a file for each, and the table of all files in the folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", type=Path, nargs="+", metavar="DATASET")
    parser.add_argument("--real", type=Path, required=True, metavar="LIST", help="real clouds, see docs/compare.md")
    parser.add_argument("--words", default="real clouds", metavar="TEXT", help="what the real clouds are")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder of certificates")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for folder in arguments.datasets:
        data = certify(folder, arguments.real, arguments.words)
        (arguments.output / f"{folder.name}.json").write_text(canonical_json(data), encoding="utf-8")
        print(folder.name, json.dumps(data["realism"]), flush=True)
    rows = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(arguments.output.glob("*.json"))]
    arguments.output.with_suffix(".md").write_text(table(rows, arguments.output.name), encoding="utf-8")


if __name__ == "__main__":
    main()
