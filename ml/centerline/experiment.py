"""Experiments with centrelines: learned from real, synthetic and mixed roads, tested on real ones left out."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence, Set
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import write_file
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.base.schema import canonical_json, is_number
from synthroads_addon.dataset.manifest import checksum

from ..configuration import Part
from ..data.batches import MeasuredRoad
from ..data.roads import LearningRoad, read_measured
from ..experiments import Experiment as AnyExperiment
from ..experiments import cached_scores, fill_path, read_figures, with_seed, write_results
from ..runs import METRICS, Run, to_json_data
from ..scores.baselines import SkeletonSettings
from ..scores.distances import METRICS as FIGURES
from ..scores.distances import over_roads
from ..scores.evaluation import Predictor, evaluate, skeleton_predictor, trivial_predictors
from ..scores.metrics import Metric, markdown, over_seeds
from ..scores.tables import cell
from .measuring import measured_case
from .rules import views_predictor
from .task import CenterlineConfiguration, load_predictor, train

VIEWS, PATH = "views", "the displaced path"
"""Names of the rules in tables."""
_SHOWN = ("mae", "chamfer_full", "coverage_68", "coverage_95")
"""Figures that have a table."""
_LONGEST_NAME = 80
"""Characters of a folder's name at most. Chosen: file systems allow 255 bytes, and paths have several folders."""
Results = Mapping[str, Mapping[str, Mapping[str, Mapping[str, float | None]]]]
"""Variant or rule -> seed -> road -> figures, as JSON data."""


class Data(Part):
    """Real and synthetic roads to learn from; real ones are left out in turns, to test on."""

    real: tuple[MeasuredRoad, ...] = Field((), description="Real roads.")
    synthetic: tuple[str, ...] = Field((), description="Folders that `synthroads dataset` made.")
    left_out: tuple[tuple[str, ...], ...] = Field(
        (),
        description="Groups of real roads that are left out together, in turn; if empty, each road alone.",
    )


class Experiment(AnyExperiment):
    """Trainings to be compared, as read from YAML; paths of data may begin with {NAME}, filled in by --data."""

    task: Literal["centerline"] = Field("centerline", description="Task: centerline.")
    configuration: str = Field("centerline-transformer", description="Configuration that all variants start from.")
    data: Data = Field(description="Roads of all variants.")

    def filled_data(self, folders: Mapping[str, str]) -> dict[str, Any]:
        """Return data sets and real roads with {NAME} in all paths replaced by its folder; see the base class."""
        real = [road.model_copy(update={"cloud": fill_path(road.cloud, folders)}) for road in self.data.real]
        return {
            "data_sets": [fill_path(path, folders) for path in self.data.synthetic],
            "measured": [road.to_dict() for road in real],
        }


def run_experiment(
    experiment: Experiment,
    configurations: Mapping[str, CenterlineConfiguration],
    output: Path,
    seeds: Sequence[int],
    progress: Progress = silent,
) -> dict[str, Any]:
    """Train (unless done) and test all variants with the given seeds; return the figures, written after each.

    A variant that learns from real roads is trained once for each group of roads left out (a turn), and tested on
    these.

    Args:
        experiment: what is compared.
        configurations: see `experiments.configurations`.
        output: folder; ``VARIANT/without-ROADS/seed-N`` are the runs, or ``VARIANT/seed-N`` where no real road is
            learned from, `RESULTS` and `TABLE` the figures.
        seeds: one after another, each over all variants: a table is there as soon as the first is through.
        progress: called with each training's stage and share.

    Raises:
        InputError: no variant learns from real roads, or a road to leave out isn't among them.
    """
    roads = _real_roads(configurations)
    turns = _turns(experiment.data.left_out, roads)
    test_roads = [name for turn in turns for name in turn]
    figures: dict[str, dict[str, Any]] = {name: {} for name in configurations}
    for seed in seeds:
        for name, variant in experiment.variants.items():
            results: dict[str, Any] = {}
            for turn in turns:
                configuration = _leave_out_roads(with_seed(configurations[name], seed), turn, roads)
                folder_name = _folder_without(turn)
                variant_folder = output / (variant.of or name)
                folder = (
                    variant_folder / folder_name if configuration.data.measured else variant_folder
                ) / f"seed-{seed}"
                if variant.of is None:
                    _train_run(configuration, folder, progress)
                file = output / name / f"{folder_name}-seed-{seed}.json"
                results |= _test_run(Run(folder, configuration), {road: roads[road] for road in turn}, file, progress)
            figures[name][str(seed)] = {road: results[road] for road in test_roads}
            write_results(output, figures, table(experiment.title, figures, list(configurations)))
        settings = configurations[next(iter(configurations))]
        for rule, results in _rule_figures(
            settings, seed, {road: roads[road] for road in test_roads}, output, progress
        ).items():
            figures.setdefault(rule, {})[str(seed)] = results
        write_results(output, figures, table(experiment.title, figures, list(configurations)))
    return figures


def _real_roads(configurations: Mapping[str, CenterlineConfiguration]) -> dict[str, tuple[Path, Path]]:
    """Return cloud and axis of each real road that a variant learns from, by name.

    Raises:
        InputError: there are no real roads, or two have the same name.
    """
    roads: dict[str, tuple[Path, Path]] = {}
    for configuration in configurations.values():
        for cloud, axis in (files for road in configuration.data.measured for files in road.files()):
            if roads.setdefault(cloud.stem, (cloud, axis)) != (cloud, axis):
                raise InputError(
                    "data.real",
                    cloud.stem,
                    "is the name of several real roads: rename their files, as left_out selects roads by name",
                )
    if not roads:
        raise InputError("data.real", [], "must name at least one real road, as the variants are tested on real roads")
    return roads


def _turns(left_out: Sequence[Sequence[str]], roads: Mapping[str, object]) -> list[list[str]]:
    """Return the names of the roads that are left out together, turn by turn; each by itself if nothing is stated.

    Raises:
        InputError: a name is none of the roads, or stands in two turns.
    """
    turns = [list(turn) for turn in left_out] or [[name] for name in roads]
    names = [name for turn in turns for name in turn]
    for name in names:
        if name not in roads:
            raise InputError("left_out", name, f"must be one of the real roads: {', '.join(roads)}")
        if names.count(name) > 1:
            raise InputError("left_out", name, "is left out twice")
    return turns


def _leave_out_roads(
    configuration: CenterlineConfiguration, turn: Sequence[str], roads: Mapping[str, tuple[Path, Path]]
) -> CenterlineConfiguration:
    """Return a variant's configuration with the roads of a turn left out of what it learns from.

    Raises:
        InputError: no other real road is left.
    """
    remaining_roads = []
    for road in configuration.data.measured:
        if Path(road.cloud).is_dir():
            left_out = {*road.left_out, *(name for name in turn if roads[name][0].parent == Path(road.cloud))}
            if any(cloud.stem not in left_out for cloud, _ in road.files()):
                remaining_roads.append(road.model_copy(update={"left_out": tuple(sorted(left_out))}))
        elif Path(road.cloud).stem not in turn:
            remaining_roads.append(road)
    if configuration.data.measured and not remaining_roads:
        raise InputError("left_out", list(turn), "must leave at least one real road for the training")
    data = configuration.data.model_copy(update={"measured": tuple(remaining_roads)})
    return configuration.model_copy(update={"data": data})


def _folder_without(turn: Sequence[str]) -> str:
    """Return the name of the folder for runs trained without a turn's roads."""
    names = "+".join(turn)
    if len(names) > _LONGEST_NAME:
        names = f"{names[:_LONGEST_NAME]}-{hashlib.sha256(names.encode()).hexdigest()[:8]}"
    return f"without-{names}"


def _train_run(configuration: CenterlineConfiguration, folder: Path, progress: Progress) -> None:
    """Train the run of a folder, or go on with it, unless it is finished."""
    run = Run.start(folder, configuration, resume=True)
    if not (folder / METRICS).is_file():
        train(run, progress)


def _test_run(
    run: Run[CenterlineConfiguration], roads: Mapping[str, tuple[Path, Path]], file: Path, progress: Progress
) -> dict[str, Any]:
    """Return a trained run's figures by road, cached in a file as long as run, clouds and axes stay as they are."""

    def score() -> dict[str, Any]:
        """Return the trained model's figures by road."""
        return _measure_predictors({"": load_predictor(run)}, run.configuration, roads, progress)[""]

    return cached_scores(run, file, score, partial(_are_figures, names=set(roads)), roads=_checksums(roads))


def _rule_figures(
    configuration: CenterlineConfiguration,
    seed: int,
    roads: Mapping[str, tuple[Path, Path]],
    output: Path,
    progress: Progress,
) -> dict[str, dict[str, Any]]:
    """Return the figures by road of all rule-based predictors, cached in the experiment's folder."""
    file = output / "rules" / f"seed-{seed}.json"
    made_from = {"slices": configuration.slices.to_dict(), "roads": _checksums(roads)}
    trivial_rules = {
        name: predictor for name, (predictor,) in trivial_predictors(configuration.slices.half_width).items()
    }
    predictors = {VIEWS: views_predictor(), "skeleton": skeleton_predictor(SkeletonSettings())} | trivial_rules

    def are_sound(data: Any) -> bool:
        """Return whether JSON data are figures of all rules on all roads."""
        has_names = isinstance(data, dict) and data.keys() == predictors.keys()
        return has_names and all(_are_figures(figures, set(roads)) for figures in data.values())

    if (figures := read_figures(file, "rules", made_from, are_sound)) is not None:
        return figures
    rules = _measure_predictors(predictors, with_seed(configuration, seed), roads, progress)
    write_file(file, canonical_json({"made_from": made_from, "rules": rules}).encode(), overwrite=True)
    return rules


def _measure_predictors(
    predictors: Mapping[str, Predictor],
    configuration: CenterlineConfiguration,
    roads: Mapping[str, tuple[Path, Path]],
    progress: Progress,
) -> dict[str, dict[str, Any]]:
    """Return each predictor's figures by road as JSON data, all on the same points in the same frames."""
    figures: dict[str, dict[str, Any]] = {name: {} for name in predictors}
    settings = configuration.slices
    for number, (road, (cloud, axis)) in enumerate(roads.items()):
        progress(f"measuring on {road}", number / len(roads))
        learning_road: LearningRoad = read_measured(cloud, axis, settings.truth)
        case = measured_case(learning_road, configuration.seed, settings)
        for name, predictor in predictors.items():
            figures[name][road] = to_json_data(evaluate(predictor, case))
    return figures


def _are_figures(data: Any, names: Set[str]) -> bool:
    """Return whether JSON data are one predictor's figures by road, as `_measure_predictors` makes them."""
    if not isinstance(data, dict) or data.keys() != names:
        return False
    for figures in data.values():
        if not isinstance(figures, dict) or not figures.keys() <= FIGURES.keys() or figures.get("slices") is None:
            return False
        if not all(value is None or is_number(value) for value in figures.values()):
            return False
    return True


def _checksums(roads: Mapping[str, tuple[Path, Path]]) -> dict[str, list[str]]:
    """Return the checksums of cloud and axis of each road, by name."""
    return {name: [checksum(path) for path in files] for name, files in roads.items()}


def table(title: str, results: Results, variants: Sequence[str]) -> str:
    """Return a Markdown page with a table per figure: variants and rules, road by road, mean (deviation over seeds).

    Args:
        title: above the tables.
        results: figures of variants and of rules, see `Results`; those without a seed are left out.
        variants: the variants' names; all others are rules, of which the best of each road is shown.
    """
    results_by_name = {name: seeds for name, seeds in results.items() if seeds}
    first_variant = next(iter(results_by_name.values()), {})
    roads = list(next(iter(first_variant.values()), {}))
    spreads = {name: _spread_figures(seeds, roads) for name, seeds in results_by_name.items()}
    lines = [
        f"# {title}",
        "",
        "Mean (standard deviation over seeds, ddof 1); roads that were left out of the training.",
        "",
    ]
    for figure in _SHOWN:
        metric = FIGURES[figure]
        rows = [
            [name, *(cell(spread.get(figure), metric) for spread in spreads[name].values())]
            for name in spreads
            if name in (*variants, VIEWS)
        ]
        if not metric.title.startswith("in ") and len(results_by_name) > len(variants):
            rows.append(_best_rule(spreads, variants, metric, figure))
        lines += [f"**{metric.title}**", "", markdown(["", *roads, "all"], rows)]
    counts = ", ".join(f"{name} {len(results_by_name[name])}" for name in variants if name in results_by_name)
    return "\n".join([*lines, f"Seeds: {counts}.", ""])


def _spread_figures(seeds: Mapping[str, Mapping[str, Any]], roads: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the spread over seeds of each figure by road, and of all roads together, weighted by their slices."""
    by_seed = [{road: _nan_for_none(by_road[road]) for road in roads} for by_road in seeds.values()]
    for rows in by_seed:
        rows["all"] = over_roads([rows[road] for road in roads])
    return {road: over_seeds([rows[road] for rows in by_seed]) for road in (*roads, "all")}


def _nan_for_none(figures: Mapping[str, float | None]) -> dict[str, float]:
    """Return a road's figures with NaN in the place of None."""
    return {name: float("nan") if value is None else value for name, value in figures.items()}


def _best_rule(
    spreads: Mapping[str, Mapping[str, Any]], variants: Sequence[str], metric: Metric, figure: str
) -> list[str]:
    """Return a table's row with the smallest mean of a figure over the rules, road by road."""
    rules = [name for name in spreads if name not in (*variants, VIEWS, PATH)]
    row = ["best of the rules"]
    for road in spreads[rules[0]]:
        rule_spreads = [spreads[name][road][figure] for name in rules if figure in spreads[name][road]]
        measured_spreads = [spread for spread in rule_spreads if not math.isnan(spread.mean)]
        row.append(cell(min(measured_spreads, key=lambda spread: spread.mean, default=None), metric))
    return row
