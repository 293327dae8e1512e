"""Rebuild real roads from their clouds, scan them as the originals were, and measure how real the new clouds are.

    python studies/realism/rebuilt.py --real real.yaml --stretch als_rural2lane_t211-278 120 400 --output out/rebuilt

The list is one of `synthroads compare`, of two clouds or more beside their axes (docs/compare.md). Of each cloud that a
`--stretch` names, the points whose nearest point of the axis lies between these two lengths along it, m, are
reconstructed without being told anything of the road (`synthroads reconstruct`). Blender builds and scans the result
with the sensor of a scenario (`synthroads generate --parameters`), with as many seeds as wanted, and each cloud is
compared with all of the list, and with the road alone that it was rebuilt from. Tables of sections, of the rules broken
and of the realism are printed in Markdown. Nothing is written anywhere but to the output folder; what is there already
isn't made again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.checking.checker import check  # noqa: E402
from synthroads_addon.comparison.classifier import classifier_auc  # noqa: E402
from synthroads_addon.comparison.clouds import ListedCloud, find_clouds  # noqa: E402
from synthroads_addon.comparison.job import CloudComparison, compare  # noqa: E402
from synthroads_addon.road.parameters import RoadParameters, read_parameters  # noqa: E402
from synthroads_addon.road.section import Carriageway  # noqa: E402

_COMMAND = (sys.executable, "-c", "import sys; from headless.cli import main; sys.exit(main())")
_DOUBTFUL = 3
"""Exit code of `synthroads reconstruct` for a road with doubtful stretches."""
_GROUPS = ("all", "pattern", "geometry", "intensity")


@dataclass(frozen=True)
class Stretch:
    """Part of a real road that is rebuilt.

    Attributes:
        cloud: file of the whole cloud.
        axis: file (CSV) with the columns s, x and y of its axis, m.
        begin, end: lengths along the axis, m.
    """

    cloud: Path
    axis: Path
    begin: float
    end: float

    @property
    def name(self) -> str:
        """The cloud's name."""
        return self.cloud.stem


def find_stretches(rows: list[tuple[Path, ListedCloud]], wanted: list[list[str]]) -> list[Stretch]:
    """Return the stretches that the command line names.

    Raises:
        InputError: the list has no cloud of that name beside an axis, or its end isn't behind its beginning.
    """
    row_of_name = {path.stem: (path, row) for path, row in rows if row.axis is not None}
    result = []
    for name, begin, end in wanted:
        if name not in row_of_name:
            raise InputError("--stretch", name, f"must be a cloud beside an axis: {', '.join(row_of_name)}")
        if float(begin) >= float(end):
            raise InputError("--stretch", f"{begin} {end}", "must end behind its beginning")
        path, row = row_of_name[name]
        result.append(Stretch(path, path.parent / str(row.axis), float(begin), float(end)))
    return result


def cut(stretch: Stretch, file: Path) -> None:
    """Write the points of a stretch as a cloud of its own."""
    axis = np.genfromtxt(stretch.axis, delimiter=",", names=True)
    cloud = laspy.read(stretch.cloud)
    nearest = cKDTree(np.column_stack([axis["x"], axis["y"]])).query(np.column_stack([cloud.x, cloud.y]))[1]
    length = axis["s"][nearest]
    cloud.points = cloud.points[(length >= stretch.begin) & (length < stretch.end)]
    file.parent.mkdir(parents=True, exist_ok=True)
    cloud.write(str(file))


def run(*arguments: str, allowed: tuple[int, ...] = (0,)) -> None:
    """Run a command of synthroads, which may end with one of these exit codes.

    Raises:
        RuntimeError: it ends with another one.
    """
    code = subprocess.run([*_COMMAND, *arguments, "--quiet", "--overwrite"], cwd=ROOT, check=False).returncode
    if code not in allowed:
        raise RuntimeError(f"synthroads {arguments[0]} ended with exit code {code}")


def rebuild(stretch: Stretch, folder: Path, scenario: str, settings: list[str], seeds: range) -> list[Path]:
    """Cut a stretch, reconstruct its road, and scan the rebuilt road once for each seed; return the clouds' files."""
    real, road = folder / "cut" / f"{stretch.name}.laz", folder / "roads" / stretch.name
    if not real.exists():
        cut(stretch, real)
    if not (road / "parameters.json").exists():
        run("reconstruct", str(real), "--output", str(road), allowed=(0, _DOUBTFUL))
    files = []
    for seed in seeds:
        scene = folder / "scenes" / f"{stretch.name}-{seed}"
        if not (scene / "cloud.laz").exists():
            parameters = ["--parameters", str(road / "parameters.json"), "--seed", str(seed)]
            changes = [part for text in [*settings, 'outputs=["cloud"]'] for part in ("--set", text)]
            run("generate", "--scenario", scenario, *parameters, *changes, "--output", str(scene))
        files.append(scene / "cloud.laz")
    return files


def road_row(name: str, parameters: RoadParameters) -> str:
    """Return a rebuilt road's length, class, widths of lanes, and the rules that it breaks, as a row in Markdown."""
    carriageways = [one for one in parameters.objects.values() if isinstance(one, Carriageway)]
    lanes = ", ".join(f"{one.side} " + " + ".join(f"{lane.width:.2f}" for lane in one.lanes) for one in carriageways)
    counts = Counter(violation.rule for violation in check(parameters))
    broken = ", ".join(f"{rule} ({count})" for rule, count in sorted(counts.items())) or "none"
    length = sum(element.length for element in parameters.alignment.horizontal)
    return f"| {name} | {length:.0f} | {parameters.design_class} | {lanes} | {broken} |"


def realism_of_own_road(result: CloudComparison, number: int, name: str) -> dict[str, float]:
    """Return the realism by group of a synthetic cloud against the one real cloud of its road.

    Args:
        result: of the comparison with all real clouds.
        number: of the synthetic cloud.
        name: of the road's real cloud, against which the other real ones are the yardstick.
    """
    road = next(cloud for cloud in result.real if cloud.cloud.name == name)
    own = classifier_auc(result.synthetic[number].patches, road.patches, 1, name)
    others = [
        classifier_auc(cloud.patches, road.patches, 1, cloud.cloud.name) for cloud in result.real if cloud is not road
    ]
    return {
        group: (1.0 - max(own[group], 0.5)) / max(float(np.mean([1.0 - max(auc[group], 0.5) for auc in others])), 1e-9)
        for group in _GROUPS
    }


def realism_lines(result: CloudComparison, names: list[str]) -> list[str]:
    """Return AUC and realism of rebuilt roads as a table in Markdown.

    Args:
        result: of the comparison.
        names: real cloud of each synthetic one's road.
    """
    lines = [f"| rebuilt road | patches | {' | '.join(_GROUPS)} |", "|---|--:|" + "--:|" * len(_GROUPS)]
    data = result.to_dict()
    for row, name in zip(data["synthetic"], names, strict=True):
        cells = " | ".join(f"{row['auc'][group]:.2f}" for group in _GROUPS)
        lines.append(f"| {name}: AUC | {row['patches']} | {cells} |")
    for row in data["real"]:
        cells = " | ".join(f"{row['auc'][group]:.2f}" for group in _GROUPS)
        lines.append(f"| {row['cloud']}, real: AUC | {row['patches']} | {cells} |")
    cells = " | ".join(f"{data['realism'][group]:.2f}" for group in _GROUPS)
    lines.append(f"| realism | | {cells} |")
    for number, name in enumerate(names):
        own = realism_of_own_road(result, number, name)
        lines.append(f"| {name}: realism against this road alone | | {' | '.join(f'{own[g]:.2f}' for g in _GROUPS)} |")
    return lines


def statistics_lines(result: CloudComparison, names: list[str]) -> list[str]:
    """Return each statistic's median of every cloud as a table in Markdown, the rebuilt ones first.

    Args:
        result: of the comparison.
        names: real cloud of each synthetic one's road.
    """
    heads = [f"{name}, rebuilt" for name in names] + [f"{cloud.cloud.name}, real" for cloud in result.real]
    medians = [cloud.to_dict()["medians"] for cloud in (*result.synthetic, *result.real)]
    lines = [f"| statistic | {' | '.join(heads)} |", "|---|" + "--:|" * len(heads)]
    lines += [
        f"| {statistic} | " + " | ".join(f"{values[statistic]:.3g}" for values in medians) + " |"
        for statistic in medians[0]
    ]
    return lines


def main() -> None:
    """Rebuild the command line's stretches, and print their tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, required=True, metavar="LIST", help="real clouds, see docs/compare.md")
    parser.add_argument("--stretch", nargs=3, action="append", required=True, metavar=("NAME", "FROM", "TO"))
    parser.add_argument("--scenario", default="country-600m", help="whose sensor scans the roads (country-600m)")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="change of the scenario")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="scans of each road (1)")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    arguments = parser.parse_args()
    folder = arguments.output.resolve()
    stretches = find_stretches(find_clouds(arguments.real), arguments.stretch)
    files, names = [], []
    print("| road | length (m) | class | lanes (m) | rules broken |\n|---|--:|---|---|---|")
    for stretch in stretches:
        files += rebuild(stretch, folder, arguments.scenario, arguments.set, range(1, arguments.seeds + 1))
        names += [stretch.name] * arguments.seeds
        parameters = read_parameters(folder / "roads" / stretch.name / "parameters.json")
        print(road_row(stretch.name, parameters), flush=True)
    clouds = folder / "clouds.json"
    rows = [{"cloud": str(file), "road": "road", "marking": "road_marking"} for file in files]
    clouds.write_text(json.dumps({"type": "CloudList", "clouds": rows}), encoding="utf-8")
    result = compare(clouds, arguments.real)
    print("\n" + "\n".join(realism_lines(result, names)))
    print("\n" + "\n".join(statistics_lines(result, names)))


if __name__ == "__main__":
    main()
