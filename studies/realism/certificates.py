"""Certify recipes: how real their clouds are, as `synthroads compare` says, in one table and a file for each.

    synthroads dataset centerline-airborne --splits test --set road.length=200 --output out/centerline-airborne
    python studies/realism/certificates.py --real real.yaml --output docs/certificates out/centerline-airborne

Each folder is a data set that `synthroads dataset` has made, named as its recipe, or one of clouds of a scenario, named
as that:

    synthroads generate --scenario airborne-1000m --set road.length=250 --output out/airborne-1000m/scenes/seed-5

Every cloud of it is compared with
all of the real ones. `docs/certificates/RECIPE.json` holds AUC, realism and statistics, `docs/certificates.md` the
tables over all files in the folder, those of earlier runs included: recipes for other kinds of scanner are certified by
other real clouds.

    synthroads dataset sweeps --splits test --set 'cloud.attributes=["range"]' --output out/sweeps
    python studies/realism/certificates.py --sweeps --real halves.yaml --output docs/certificates out/sweeps

Single sweeps have too few points for patches. They are certified by the figures of `sweeps.py`, beside two or
more real sweeps or parts of one.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.realism.sweeps import SweepFigures, named_figures, sweep_figures  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.base.progress import exhaust  # noqa: E402
from synthroads_addon.base.schema import canonical_json  # noqa: E402
from synthroads_addon.comparison.clouds import find_clouds  # noqa: E402
from synthroads_addon.comparison.job import CloudComparison, compare_steps  # noqa: E402
from synthroads_addon.dataset.recipe import load_recipe, recipe_names  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario, scenario_names  # noqa: E402

_SHOWN = 3
_SIDES = ("synthetic", "real")
_RANGE = 1.5
"""Statistics of a cloud count as real within this many times the range of the real clouds' ones, about its middle."""
_BY_PATCHES, _BY_FIGURES = "Certificate", "SweepCertificate"
WITHOUT = {
    "centerline-mobile": "no real cloud of a road by line scanners on a vehicle or from a tripod was available",
    "centerline-uav": "no real cloud of a road, recorded by a UAV, was available",
    "changes": "no real cloud of a road, recorded by a UAV, was available",
    "country-mobile": "no real cloud of a country road by line scanners on a vehicle was available",
    "package-models": "it has several sensors, and real clouds of one sensor can't judge the whole set",
    "mobile-mapping-300m": "no real cloud of a road by line scanners on a vehicle was available",
    "reference": "no real cloud of a road, recorded by a UAV, was available",
    "rq31-600m": "no real cloud of a road, recorded by a UAV, was available",
    "small-gantries": "no real cloud of a road, recorded by a UAV, was available",
    "small-roads": "no real cloud of a road, recorded by a UAV, was available",
    "standin": "it replaces real clouds where there are none, and simulates no particular sensor",
    "tripod-200m": "no real cloud of a road from a tripod was available",
    "village-mobile": "it was compared with no real cloud of a street",
}
"""Shipped recipes and usual scenarios without a certificate, and why they have none."""


def certificate(recipe: str, result: CloudComparison, real: str) -> dict[str, Any]:
    """Return a recipe's certificate as JSON data.

    Args:
        recipe: its name.
        result: of all its clouds.
        real: what the real clouds are, in words.
    """
    data = result.to_dict()
    left_out = {
        road: {group: round(value, 4) for group, value in groups.items()}
        for road, groups in (result.realism_left_out() if len(data["real"]) > 1 else {}).items()
    }
    auc = {group: _spread([row["auc"][group] for row in data["synthetic"]]) for group in data["realism"]}
    yardstick = {group: _spread([row["auc"][group] for row in data["real"]]) for group in data["realism"]}
    return {
        "type": _BY_PATCHES,
        "recipe": recipe,
        "title": _title(recipe),
        "real": real,
        "clouds": len(data["synthetic"]),
        "patches": sum(row["patches"] for row in data["synthetic"]),
        "auc": auc,
        "yardstick": yardstick,
        "realism": data["realism"],
        "realism_left_out": left_out,
        "giveaways": dict(list(data["giveaways"].items())[:_SHOWN]),
        "statistics": _statistics(data),
    }


def _title(name: str) -> str:
    """Return the title of a shipped recipe or scenario; a recipe's, where there are both."""
    return (
        load_scenario(name).title
        if name in scenario_names() and name not in recipe_names()
        else load_recipe(name).title
    )


def _spread(values: list[float]) -> list[float]:
    """Return the least, the mean and the largest of some values."""
    return [round(float(value), 3) for value in (min(values), np.mean(values), max(values))]


def _statistics(data: dict[str, Any]) -> dict[str, Any]:
    """Return each statistic's medians, real and synthetic, and how many clouds lie within the real ones' range."""
    names = data["synthetic"][0]["medians"]
    return {name: _spreads(*([row["medians"][name] for row in data[side]] for side in _SIDES)) for name in names}


def _spreads(synthetic_values: list[float], real_values: list[float]) -> dict[str, Any]:
    """Return the spread of synthetic and real clouds' values, and how many of the first are within the real range."""
    middle, half_range = (
        (max(real_values) + min(real_values)) / 2.0,
        _RANGE * (max(real_values) - min(real_values)) / 2.0,
    )
    count_inside = sum(abs(value - middle) <= half_range for value in synthetic_values)
    return {"synthetic": _spread(synthetic_values), "real": _spread(real_values), "within": count_inside}


def sweep_certificate(
    recipe: str, synthetic: list[SweepFigures], real: list[SweepFigures], words: str
) -> dict[str, Any]:
    """Return the certificate of a recipe of single sweeps as JSON data: figures that all of its and all real ones have.

    Args:
        recipe: its name.
        synthetic: figures of its sweeps.
        real: those of two or more real ones, or parts of one.
        words: what these are.

    Raises:
        InputError: there is but one real one, which has no range.
    """
    if len(real) < 2:
        raise InputError("--real", len(real), "must be two real sweeps or parts of one, or more: one has no range")
    synthetic_rows, real_rows = (
        [named_figures(figures_of_sweep) for figures_of_sweep in side] for side in (synthetic, real)
    )
    names = [
        name for name in synthetic_rows[0] if np.isfinite([row[name] for row in [*synthetic_rows, *real_rows]]).all()
    ]
    figures = {
        name: _spreads([row[name] for row in synthetic_rows], [row[name] for row in real_rows]) for name in names
    }
    return {
        "type": _BY_FIGURES,
        "recipe": recipe,
        "title": _title(recipe),
        "real": words,
        "clouds": len(synthetic_rows),
        "statistics": figures,
    }


def pages(rows: list[dict[str, Any]], folder: str) -> str:
    """Return certificates of both kinds, and why other recipes have none, as a Markdown page beside their folder."""
    by_patches, by_figures = ([row for row in rows if row["type"] == kind] for kind in (_BY_PATCHES, _BY_FIGURES))
    text = table(by_patches, folder)
    if by_figures:
        text += sweep_table(by_figures, folder)
    certified_names = {row["recipe"] for row in rows}
    reason_of_name = {name: reason for name, reason in WITHOUT.items() if name not in certified_names}
    lines = ["", "## Without a certificate", "", *(f"- `{name}`: {reason}." for name, reason in reason_of_name.items())]
    return text + "\n".join([*lines, ""])


def sweep_table(rows: list[dict[str, Any]], folder: str) -> str:
    """Return certificates of single sweeps as a section in Markdown."""
    lines = [
        "",
        "## Single sweeps",
        "",
        "A single sweep has too few points to be cut into patches, and one real sweep alone doesn't show how",
        "much real sweeps differ from each other. Therefore the real sweep is divided by azimuth into a front",
        "and a back half, with gaps of 20 deg between them, and the two halves count as two real sweeps. The",
        "certificate uses those figures of [the table of sweeps](devices.md#a-heads-sweeps-beside-a-real-one)",
        f"that every sweep has. A figure counts as within range if it lies within {_RANGE:g} times the range",
        "of the two halves, about the middle of this range. If both halves have nearly the same value, this",
        "range is so narrow that hardly any sweep lies within it. This command makes the certificate:",
        "",
        "    python studies/realism/certificates.py --sweeps --real HALVES --output docs/certificates DATASET ...",
        "",
        "| recipe | sweeps | figures within range | figures that are never within range | compared with |",
        "|---|--:|--:|---|---|",
    ]
    for row in rows:
        total = row["clouds"] * len(row["statistics"])
        count_within = sum(statistic["within"] for statistic in row["statistics"].values())
        never_text = "; ".join(
            f"{name}: {statistic['synthetic'][1]:g} (real {statistic['real'][0]:g} to {statistic['real'][2]:g})"
            for name, statistic in row["statistics"].items()
            if not statistic["within"]
        )
        name = f"[`{row['recipe']}`]({folder}/{row['recipe']}.json)"
        lines.append(f"| {name} | {row['clouds']} | {count_within} of {total} | {never_text} | {row['real']} |")
    return "\n".join([*lines, ""])


def table(rows: list[dict[str, Any]], folder: str) -> str:
    """Return certificates as a Markdown page beside the folder that their files are in."""
    groups = list(rows[0]["realism"])
    last_columns = "statistics within range | most distinctive statistics (AUC) | compared with"
    lines = [
        "# How real are the recipes' clouds?",
        "",
        "The table shows how well a classifier tells the clouds of each recipe from real clouds ([how this is",
        "measured](compare.md)): the AUC, as the mean over all clouds of the recipe, and in brackets the",
        "realism, which is 1 - AUC divided by the 1 - AUC of the real clouds among each other. A statistic of",
        f"a cloud counts as within range if its median lies within {_RANGE:g} times the range of the real",
        "clouds' medians, about the middle of this range. The clouds are the test scenes of the recipes with",
        "200 m of road; that of `centerline-airborne-even` is the cloud of",
        "[compare.md](compare.md#what-it-says-of-ours), those of the scenario `airborne-1000m` have 250 m of road",
        "and the seeds 5 to 7. This command makes the certificates:",
        "",
        "    python studies/realism/certificates.py --real LIST --output docs/certificates DATASET ...",
        "",
        f"| recipe | clouds | {' | '.join(groups)} | {last_columns} |",
        "|---|--:|" + "--:|" * len(groups) + "--:|---|---|",
    ]
    for row in rows:
        cells = [f"{row['auc'][group][1]:.2f} ({row['realism'][group]:.2f})" for group in groups]
        total = row["clouds"] * len(row["statistics"])
        count_within = sum(statistic["within"] for statistic in row["statistics"].values())
        giveaways_text = ", ".join(f"{name} {auc:.2f}" for name, (auc, _) in row["giveaways"].items())
        name = f"[`{row['recipe']}`]({folder}/{row['recipe']}.json)"
        cells += [f"{count_within} of {total}", giveaways_text, row["real"]]
        lines.append(f"| {name} | {row['clouds']} | {' | '.join(cells)} |")
    return "\n".join([*lines, *_left_out_lines(rows), ""])


def _left_out_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table of realism against roads that were left out, as lines of Markdown; empty without any."""
    rows_left_out = [row for row in rows if row.get("realism_left_out")]
    if not rows_left_out:
        return []
    groups = list(rows[0]["realism"])
    lines = [
        "",
        "## With each road left out",
        "",
        "The recipes' ranges were chosen by looking at all of these roads. This table shows how far a choice",
        "made on some of them holds on another: each real road in turn is left out, the half of the recipe's",
        "clouds is taken that is hardest to tell from each of the other roads, and these are compared with the",
        "road that was left out, alone. The figures are realism: 1 - AUC of the synthetic clouds divided by the",
        "1 - AUC of the other real roads against the same road.",
        "",
        f"| recipe | road left out | {' | '.join(groups)} |",
        "|---|---|" + "--:|" * len(groups),
    ]
    for row in rows_left_out:
        left_out = row["realism_left_out"]
        means = {group: float(np.mean([values[group] for values in left_out.values()])) for group in groups}
        for road, values in [*left_out.items(), ("mean", means)]:
            lines.append(
                f"| `{row['recipe']}` | {road} | " + " | ".join(f"{values[group]:.2f}" for group in groups) + " |"
            )
    return lines


def certify(folder: Path, real: Path, words: str, are_sweeps: bool = False) -> dict[str, Any]:
    """Compare the clouds of a data set, or its single sweeps, with real ones; return its certificate.

    Raises:
        InputError: it holds no cloud, see also `compare_steps`.
    """
    clouds = folder / "scenes"
    if not clouds.is_dir():
        raise InputError(str(folder), None, "must be a data set that synthroads dataset has made")
    if are_sweeps:
        synthetic_figures, real_figures = (
            [sweep_figures(*cloud_and_row) for cloud_and_row in find_clouds(path)] for path in (clouds, real)
        )
        return sweep_certificate(folder.name, synthetic_figures, real_figures, words)
    result = exhaust(compare_steps(clouds, real), lambda share: None)
    return certificate(folder.name, result, words)


def main() -> None:
    """Certify the command line's data sets: write a file for each, and the table of all files in the folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", type=Path, nargs="+", metavar="DATASET")
    parser.add_argument("--real", type=Path, required=True, metavar="LIST", help="real clouds, see docs/compare.md")
    parser.add_argument("--words", default="real clouds", metavar="TEXT", help="what the real clouds are")
    parser.add_argument("--sweeps", action="store_true", help="by the figures of single sweeps")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder of certificates")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for folder in arguments.datasets:
        data = certify(folder, arguments.real, arguments.words, arguments.sweeps)
        (arguments.output / f"{folder.name}.json").write_text(canonical_json(data), encoding="utf-8")
        print(folder.name, json.dumps(data.get("realism", data["statistics"])), flush=True)
    rows = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(arguments.output.glob("*.json"))]
    arguments.output.with_suffix(".md").write_text(pages(rows, arguments.output.name), encoding="utf-8")


if __name__ == "__main__":
    main()
