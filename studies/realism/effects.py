"""Study one effect of the sensor at a time: what it does to the classifier, to a network, and to the time.

    python studies/realism/effects.py centerline-airborne --scene straight-08 --real real.yaml --output out/effects \\
        --set road.length=200

One scene of a recipe is built once and scanned with all effects, without each of those that the recipe asks for, and
without all of them, with the same rays and random numbers. Each cloud is compared with the real ones as `synthroads
compare` does; a small network learns on it to tell markings from pavement by point, and is asked about the real clouds;
the scan's processor time is measured. The table goes to `effects.md`, all figures to `effects.json`, a picture to
`effects.png`. Without real clouds only the time is measured, several times of which the least counts:

    python studies/realism/effects.py centerline-airborne --scene straight-08 --repeats 5 --output out/times
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from sklearn.metrics import balanced_accuracy_score
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.arrays import Float, Index  # noqa: E402
from synthroads_addon.base.classes import class_scheme  # noqa: E402
from synthroads_addon.base.errors import InputError  # noqa: E402
from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.base.progress import StageTimer, silent  # noqa: E402
from synthroads_addon.cloud.formats.registry import open_cloud  # noqa: E402
from synthroads_addon.cloud.points import PointBlock, concatenate  # noqa: E402
from synthroads_addon.cloud.selection.classes import RealClass  # noqa: E402
from synthroads_addon.cloud.selection.patches import Patches, join_patches, make_patches  # noqa: E402
from synthroads_addon.comparison.classifier import distinguish  # noqa: E402
from synthroads_addon.comparison.clouds import (  # noqa: E402
    ROAD,
    ComparedCloud,
    UnlistedCloud,
    find_clouds,
    read_compared,
)
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs  # noqa: E402
from synthroads_addon.jobs.generate import RoadSource, make_road  # noqa: E402
from synthroads_addon.jobs.open_scene import RoadScene  # noqa: E402
from synthroads_addon.scenario.scenario import Scenario, scenario_changes, with_changes  # noqa: E402
from synthroads_addon.scenario.without import EFFECTS, scenario_without  # noqa: E402

NOTHING, EVERYTHING = "none: all effects", "all of them"
MARKING = "marking"
_NEIGHBOURS = 8
_MOST = 4000
"""Points of each class that the network learns from, and is asked about in each real cloud, at most."""
_SEED = 1
_COLUMNS, _SQUARE = 5, 6.0
"""Of the picture: panels side by side, and the square that each shows, m."""


@dataclass(frozen=True)
class Outcome:
    """Figures of a scan without an effect.

    Attributes:
        effect: that is left out.
        auc: by group of statistics.
        score: mean balanced accuracy of the network on the real clouds; None where nothing has markings.
        points: of the cloud's pavement.
        seconds: processor time of the scan.
    """

    effect: str
    auc: dict[str, float]
    score: float | None
    points: int
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as JSON data."""
        auc = {group: round(value, 4) for group, value in self.auc.items()}
        score = None if self.score is None else round(self.score, 4)
        return {"effect": self.effect, "auc": auc, "score": score, "points": self.points, "seconds": self.seconds}


def variants(scenario: Scenario) -> Iterator[tuple[str, Scenario]]:
    """Yield the scenario itself, without each effect that it has, by name, and without all of these."""
    yield NOTHING, scenario
    scenario_of_effect = {effect: scenario_without(scenario, [effect]) for effect in EFFECTS}
    changed_scenarios = {
        effect: changed_scenario
        for effect, changed_scenario in scenario_of_effect.items()
        if changed_scenario != scenario
    }
    yield from changed_scenarios.items()
    yield EVERYTHING, scenario_without(scenario, changed_scenarios)


def study(scenario: Scenario, real: Path | None, output: Path, repeats: int = 1) -> Iterator[Outcome]:
    """Yield the outcome of a scenario and of it without each of its effects; builds its road once.

    Args:
        scenario: the job.
        real: list of real clouds; None to measure the time alone.
        output: folder for the clouds.
        repeats: scans of each, of whose times the least counts.

    Raises:
        InputError: a cloud or a list is wrong.
    """
    timer = StageTimer(silent)
    road, _ = make_road(RoadSource(scenario), timer)
    scene = RoadScene.of(scenario, road)
    scene.build()
    scene.read()
    real_clouds = [] if real is None else [read_compared(path, row) for path, row in find_clouds(real)]
    real_patches = (
        join_patches([make_patches(cloud.classes[ROAD], cloud.name) for cloud in real_clouds]) if real_clouds else None
    )
    real_points = [points_of(cloud) for cloud in real_clouds if MARKING in cloud.classes]
    # The first scan loads what later ones find loaded.
    scene.scan(new_folder(output / "warm-up"), timer)
    for effect, changed_scenario in variants(scenario):
        run_times, name = [], effect.partition(":")[0]
        for number in range(repeats):
            folder = new_folder(output / (f"{name} {number}" if number else name))
            begin = time.process_time()
            scene.with_settings(changed_scenario, model_stays=True).scan(folder, timer)
            run_times.append(time.process_time() - begin)
        yield outcome(effect, output / name / "cloud.laz", real_patches, real_points, min(run_times))


def new_folder(path: Path) -> Path:
    """Make a folder that isn't there yet and return it."""
    path.mkdir(parents=True)
    return path


def outcome(
    effect: str, cloud: Path, real_patches: Patches | None, real_points: Sequence[tuple[Float, Index]], seconds: float
) -> Outcome:
    """Return what a scan's cloud is like, against the patches and the points of real ones if there are any."""
    compared_cloud = read_compared(cloud, UnlistedCloud(cloud=cloud.name))
    if real_patches is None:
        return Outcome(effect, {}, None, len(compared_cloud.classes[ROAD].intensity), round(seconds, 2))
    patches = make_patches(compared_cloud.classes[ROAD], effect)
    auc = distinguish(patches, real_patches, _SEED, effect).auc
    score = (
        network_score(points_of(compared_cloud), real_points)
        if MARKING in compared_cloud.classes and real_points
        else None
    )
    return Outcome(effect, auc, score, len(compared_cloud.classes[ROAD].intensity), round(seconds, 2))


def points_of(cloud: ComparedCloud) -> tuple[Float, Index]:
    """Return what the network sees of points (N, F) of pavement and markings, and which are of markings (N,).

    Of each point its brightness over the pavement's median, the mean, least and largest of its neighbours', and its
    height over the neighbours', all in dB and m.
    """
    parts: list[RealClass] = [cloud.classes[ROAD], cloud.classes[MARKING]]
    place = np.concatenate([part.place for part in parts])
    level = 10.0 * np.log10(np.concatenate([part.intensity for part in parts]))
    label = np.repeat([0, 1], [len(part.intensity) for part in parts])
    level -= np.median(level[label == 0])
    neighbours = cKDTree(place[:, :2]).query(place[:, :2], k=_NEIGHBOURS + 1)[1][:, 1:]
    neighbour_levels, height = level[neighbours], place[:, 2] - place[neighbours, 2].mean(axis=1)
    features = np.column_stack(
        [level, neighbour_levels.mean(axis=1), neighbour_levels.min(axis=1), neighbour_levels.max(axis=1), height]
    )
    rows = np.concatenate([_some(np.flatnonzero(label == kind)) for kind in (0, 1)])
    return features[rows], label[rows]


def _some(rows: Index) -> Index:
    """Return some of the rows, at random."""
    return np.asarray(np.random.default_rng(_SEED).permutation(rows)[:_MOST])


def network_score(training_points: tuple[Float, Index], test_points: Sequence[tuple[Float, Index]]) -> float:
    """Return the mean balanced accuracy on other clouds of a network of 32 and 16 units that learned on one cloud."""
    network = MLPClassifier((32, 16), early_stopping=True, max_iter=200, random_state=_SEED)
    trained_network = make_pipeline(StandardScaler(), network).fit(*training_points)
    return float(
        np.mean([balanced_accuracy_score(label, trained_network.predict(features)) for features, label in test_points])
    )


def table(outcomes: Sequence[Outcome]) -> str:
    """Return outcomes as a Markdown table, each beside its difference to the scan with all effects."""
    groups = list(outcomes[0].auc)
    lines = [
        " | ".join(["| without", *(f"AUC {group}" for group in groups), "network's score", "points", "CPU s |"]),
        "|---|" + "--:|" * (len(groups) + 3),
    ]
    for outcome in outcomes:
        score = "-" if outcome.score is None else f"{outcome.score:.3f}"
        auc = (f"{outcome.auc[group]:.2f}" for group in groups)
        lines.append(
            " | ".join([f"| {outcome.effect}", *auc, score, f"{outcome.points:,}", f"{outcome.seconds:.2f} |"])
        )
    return "\n".join(lines) + "\n"


def draw(names: Sequence[str], folder: Path, path: Path) -> None:
    """Draw a square of the pavement without each effect, from above by brightness and from the side, and write it."""
    clouds = [concatenate(list(blocks_of(folder / name.partition(":")[0] / "cloud.laz"))) for name in names]
    middle = densest_square(clouds[0])
    columns = min(len(names), _COLUMNS)
    rows = -(-len(names) // columns)
    figure = new_figure(3.0 * columns, 4.2 * rows, layout=None)
    axes = figure.subplots(2 * rows, columns, height_ratios=[3, 1.1] * rows, squeeze=False)
    for number, (name, cloud) in enumerate(zip(names, clouds, strict=True)):
        row, column = divmod(number, columns)
        draw_square(axes[2 * row, column], axes[2 * row + 1, column], name, cloud, middle)
    for panel in range(len(names), rows * columns):
        for part in (0, 1):
            axes[2 * (panel // columns) + part, panel % columns].set_axis_off()
    figure.tight_layout()
    save_figure(figure, path, dpi=90)


def blocks_of(path: Path) -> Iterator[PointBlock]:
    """Yield the blocks of a cloud file."""
    with open_cloud(path) as cloud:
        yield from cloud.blocks()


def densest_square(cloud: PointBlock) -> Float:
    """Return the middle (2,) of the square of pavement and markings with the most points of both."""
    scheme = {row.name: row.id for row in class_scheme("5").rows}
    cell_of_point = np.floor(cloud.xyz[:, :2] / _SQUARE).astype(np.int64)
    cells, owner = np.unique(cell_of_point, axis=0, return_inverse=True)
    road, paint = (np.bincount(owner.ravel(), cloud.class_id == scheme[name]) for name in (ROAD, "road_marking"))
    return np.asarray((cells[int(np.argmax(np.minimum(road, 8.0 * paint)))] + 0.5) * _SQUARE)


def draw_square(top_axes: Any, side_axes: Any, name: str, cloud: PointBlock, middle: Float) -> None:
    """Draw one cloud's points in a square from above, by brightness in dB, and from the side."""
    position = cloud.xyz[:, :2] - middle
    rows_inside = np.flatnonzero(np.abs(position).max(axis=1) < _SQUARE / 2.0)
    x, y = position[rows_inside].T
    level = 10.0 * np.log10(np.maximum(cloud.intensity[rows_inside], 1e-12))
    height = cloud.xyz[rows_inside, 2]
    plane = np.column_stack([np.ones_like(x), x, y])
    height = height - plane @ np.linalg.lstsq(plane, height, rcond=None)[0]
    top_axes.scatter(x, y, c=level - np.median(level), s=5, vmin=-4, vmax=6, cmap="viridis")
    top_axes.set(aspect="equal", xticks=[], yticks=[])
    top_axes.set_title(name if name == NOTHING else f"without {name}", fontsize=9)
    side_axes.scatter(x, 1e3 * height, c="#444444", s=2)
    side_axes.set(ylim=(-120, 120), xticks=[], ylabel="mm")


def scenario_of(recipe: str, scene: str | None, changes: Sequence[str]) -> Scenario:
    """Return the scenario of a recipe's scene (its last one if None) with changes, ``path=value``.

    Raises:
        InputError: there is no such recipe or scene, or a change is wrong.
    """
    jobs = {job.name: job.scenario for job in scene_jobs(load_recipe(recipe))}
    if scene is not None and scene not in jobs:
        raise InputError("--scene", scene, f"must be a scene of {recipe}, e.g. {next(iter(jobs))}")
    scenario = jobs[scene] if scene is not None else list(jobs.values())[-1]
    data = with_changes(scenario.to_dict(), scenario_changes(changes))
    return Scenario.from_dict(data | {"outputs": ["cloud"]})


def main() -> None:
    """Run the study of the command line's recipe; write table and figures, and print each row as it is done."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recipe", metavar="RECIPE")
    parser.add_argument("--scene", metavar="NAME", help="scene of the recipe (its last one)")
    parser.add_argument("--real", type=Path, metavar="LIST", help="real clouds, see docs/compare.md (time alone)")
    parser.add_argument("--repeats", type=int, default=1, metavar="N", help="scans of each, the fastest counts (1)")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="change of the scenario")
    arguments = parser.parse_args()
    scenario = scenario_of(arguments.recipe, arguments.scene, arguments.set)
    outcomes = []
    for outcome in study(scenario, arguments.real, arguments.output, arguments.repeats):
        outcomes.append(outcome)
        print(json.dumps(outcome.to_dict()), flush=True)
    (arguments.output / "effects.json").write_text(json.dumps([outcome.to_dict() for outcome in outcomes], indent=1))
    draw([outcome.effect for outcome in outcomes], arguments.output, arguments.output / "effects.png")
    (arguments.output / "effects.md").write_text(table(outcomes), encoding="utf-8")


if __name__ == "__main__":
    main()
