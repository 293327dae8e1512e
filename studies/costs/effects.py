"""Measure what all effects of the sensor cost: a scene scanned with them and without them, in turn.

    python studies/costs/effects.py rq31-600m-even --like centerline-uav --repeats 3 --set road.length=200 \\
        --set scan.platform.speed=4.4 --each

The scene is built once. The effects are those that the first scene of a recipe (``--like``) has drawn, and what
``--set`` says. Scans of all kinds take turns, so that other work on the machine meets them alike, and the processor
time of each scan counts, the least of all repeats: caster, casting, colours and layers, and writing the cloud. Printed
is a Markdown table; ``--each`` has rows without one effect each as well.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.changes import apply_values  # noqa: E402
from synthroads_addon.base.progress import StageTimer, silent  # noqa: E402
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs  # noqa: E402
from synthroads_addon.jobs.generate import RoadSource, make_road  # noqa: E402
from synthroads_addon.jobs.open_scene import RoadScene  # noqa: E402
from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_changes, with_changes  # noqa: E402
from synthroads_addon.scenario.without import EFFECTS, scenario_without  # noqa: E402

ALL, NONE = "all effects", "none of them"
_OF_SENSOR = ("noise", "strip_errors", "motion", "receiver", "mirror_clock", "relief", "multipath")
"""Fields of a scan that effects come from."""


@dataclass
class ScanCost:
    """Scans of one kind.

    Attributes:
        name: which effects they have.
        scenario: of the scans.
        points: of the last cloud.
        seconds: processor time of each.
    """

    name: str
    scenario: Scenario
    points: int = 0
    seconds: list[float] = field(default_factory=list)


def with_sensor_of(scenario: Scenario, recipe: str) -> Scenario:
    """Return a scenario with the sensor's effects, and their intensities, of a recipe's first scene."""
    scene_data = scene_jobs(load_recipe(recipe))[0].scenario.to_dict()
    values = {f"scan.{name}": scene_data["scan"][name] for name in _OF_SENSOR if name in scene_data["scan"]}
    if "intensity_from_layers" in scene_data.get("colour", {}):
        values["colour.intensity_from_layers"] = scene_data["colour"]["intensity_from_layers"]
    return Scenario.from_dict(apply_values(scenario.to_dict(), values))


def kinds(scenario: Scenario, leave_out_each: bool) -> list[ScanCost]:
    """Return the kinds of scans: without any effect, with all, and, if wanted, without one each that there is."""
    effects = [effect for effect in EFFECTS if scenario_without(scenario, [effect]) != scenario]
    result = [ScanCost(NONE, scenario_without(scenario, effects)), ScanCost(ALL, scenario)]
    if leave_out_each:
        result += [ScanCost(f"without {effect}", scenario_without(scenario, [effect])) for effect in effects]
    return result


def measure(rows: Sequence[ScanCost], repeats: int) -> None:
    """Scan a scene, built once, by all kinds in turn, and add points and seconds to these."""
    timer = StageTimer(silent)
    road, _ = make_road(RoadSource(rows[0].scenario), timer)
    scene = RoadScene.of(rows[0].scenario, road)
    scene.build()
    scene.read()
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder:
        # The first scan loads what later ones find loaded.
        for number in range(repeats + 1):
            for row in rows if number % 2 else rows[:1] if not number else rows[::-1]:
                scan_folder = Path(folder) / f"{number} {row.name}"
                scan_folder.mkdir()
                begin = time.process_time()
                counts = scene.with_settings(row.scenario, model_stays=True).scan(scan_folder, timer)
                if number:
                    row.seconds.append(time.process_time() - begin)
                row.points = int(counts["points"])


def table(rows: Sequence[ScanCost]) -> str:
    """Return the costs as a Markdown table; ratios are those to the first kind, of all and by the point."""
    least_seconds = min(rows[0].seconds)
    lines = ["| scan | points | CPU s | ratio | ratio by the point |", "|---|--:|--:|--:|--:|"]
    for row in rows:
        ratio = min(row.seconds) / least_seconds
        by_point = ratio * rows[0].points / row.points
        lines.append(f"| {row.name} | {row.points:,} | {min(row.seconds):.2f} | {ratio:.2f} | {by_point:.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Measure the command line's scenario and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", metavar="NAME_OR_FILE")
    parser.add_argument("--like", metavar="RECIPE", help="recipe whose first scene's sensor has the effects")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="scans of each kind (3)")
    parser.add_argument("--each", action="store_true", help="without one effect each as well")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="change of the scenario")
    arguments = parser.parse_args()
    scenario = load_scenario(arguments.scenario)
    if arguments.like:
        scenario = with_sensor_of(scenario, arguments.like)
    data = with_changes(scenario.to_dict(), scenario_changes(arguments.set))
    rows = kinds(Scenario.from_dict(data | {"outputs": ["cloud"]}), arguments.each)
    measure(rows, arguments.repeats)
    print(table(rows), flush=True)
    # Blender's own end may hang.
    os._exit(0)


if __name__ == "__main__":
    main()
