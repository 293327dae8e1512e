"""Measure centreline models and baselines; write the tables and pictures of docs/centerline.md.

    python studies/learning/centerline.py --in-domain out/centerline-airborne --other "vehicle=out/centerline-mobile" \
        --recalibrate "vehicle=out/centerline-mobile:validation" --real REAL_FOLDER \
        --run "transformer=out/runs/transformer-1" --run "transformer=out/runs/transformer-2" \
        --output out/centerline --document docs/centerline.md --pictures docs/pictures

Runs of one name are one model trained with several seeds. A run is measured on the roads whose truth is of the kind
that it learned. What isn't given is left out, and its tables in the document stay as they are. Tables as JSON and
Markdown, and all settings that the baseline's grid search tried, are written to the output folder.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.marked_documents import put_tables  # noqa: E402
from ml.centerline.predictor import CenterlinePredictor  # noqa: E402
from ml.configuration import Part  # noqa: E402
from ml.data.batches import DataOptions  # noqa: E402
from ml.data.corridor import TRUTH_KINDS, TruthKind  # noqa: E402
from ml.data.frames import Frames  # noqa: E402
from ml.data.roads import LearningRoad, read_measured, read_scene, scene_folders  # noqa: E402
from ml.data.slices import SliceSettings  # noqa: E402
from ml.runs import Run  # noqa: E402
from ml.scores import pictures, tables  # noqa: E402
from ml.scores.baselines import SkeletonSettings, centers_on, skeletons  # noqa: E402
from ml.scores.distances import over_roads  # noqa: E402
from ml.scores.evaluation import (  # noqa: E402
    HALF_WIDTH,
    STRETCHES,
    Case,
    Cropping,
    Predictor,
    evaluate,
    make_case,
    mask_points,
    measure,
    skeleton_predictor,
    trivial_predictors,
)
from ml.scores.metrics import Spread, markdown, over_seeds  # noqa: E402
from ml.scores.paint import with_painted_line  # noqa: E402
from synthroads_addon.base.arrays import Float  # noqa: E402
from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.base.files import write_file  # noqa: E402

Measured = dict[str, dict[str, dict[str, Spread]]]
AnyPart = TypeVar("AnyPart", bound=Part)

REAL_ROADS: dict[str, tuple[str, TruthKind]] = {
    "als_rural2lane_t211-278": ("rural, 767 m", "carriageway"),
    "als_rural2lane_t000-075": ("rural, 1081 m", "carriageway"),
    "als_dual4lane_t338-369": ("dual, 315 m", "road"),
    "als_dual6lane_t370-473": ("dual, 1106 m", "road"),
}
TUNED_ON = "als_rural2lane_t000-075"
"""The real road that the baseline's grid search is run on."""
PAINTED = "als_rural2lane_t211-278"
"""The real road that has a painted line beside nearly all of its axis."""
CROPPINGS: dict[str, Cropping | None] = {
    "real-slices": Cropping(),
    "real-stretches": STRETCHES,
    "real-whole": None,
}
"""Tables of the real roads, and how their slices are cropped."""
ROAD_COLUMNS = {
    "mae": tables.COLUMNS["mae"],
    "chamfer_full": replace(tables.COLUMNS["chamfer_full"], title="Chamfer (m)"),
}
"""Columns of each road in a table that has several side by side."""
COVERAGE_COLUMNS = {name: tables.COLUMNS[name] for name in ("coverage_68", "coverage_95")}
REFERENCE = SkeletonSettings()
OTHER = "other-scanner"


@dataclass(frozen=True)
class Model:
    """A named centreline model, trained once per seed.

    Attributes:
        kind: of the truth that it learned.
        versions: one predictor per seed.
        learned: names of the real roads that it was trained or validated on, which it isn't measured on.
        half_width: of its slices, m.
    """

    kind: TruthKind
    versions: list[Predictor]
    learned: frozenset[str] = frozenset()
    half_width: float = HALF_WIDTH


@dataclass(frozen=True)
class GridSearch:
    """Result of the skeleton baseline's grid search: the settings tried, and the best.

    Attributes:
        best: of the settings that find at least `FOUND` of the slices, the one with the smallest mean distance.
        rows: settings with their figures.
    """

    best: SkeletonSettings
    rows: list[tuple[SkeletonSettings, dict[str, float]]]


FOUND = 0.8
RASTERS = (0.25, 0.5, 1.0, 2.0)
BRANCHES = (5.0, 10.0, 15.0, 30.0)
BINS = (1.0, 5.0, 10.0)
"""m."""


def grid_search(cases: Sequence[Case], masks: Sequence[str]) -> GridSearch:
    """Try all settings of the skeleton baseline on one road's cases; return the figures of each and the best."""
    rows: list[tuple[SkeletonSettings, dict[str, float]]] = []
    for mask, raster, branch in product(masks, RASTERS, BRANCHES):
        settings_to_try = [SkeletonSettings(raster, branch, mask, width) for width in BINS]
        figures_of_settings: list[list[dict[str, float]]] = [[] for _ in settings_to_try]
        for case in cases:
            frames = case.frames
            # Thinning takes the time, and doesn't depend on the bins.
            lines = skeletons(*mask_points(case.road, mask), frames.position, settings_to_try[0])
            for settings, figures in zip(settings_to_try, figures_of_settings, strict=True):
                y = centers_on(lines, frames.position, frames.direction, settings.bin)
                figures.append(evaluate(partial(_as_column, y), case))
        rows.extend(
            (settings, over_roads(figures))
            for settings, figures in zip(settings_to_try, figures_of_settings, strict=True)
        )
    sufficient_rows = [row for row in rows if row[1]["found"] >= FOUND] or rows
    best_row = min(sufficient_rows, key=lambda row: row[1]["mae"] if np.isfinite(row[1]["mae"]) else np.inf)
    return GridSearch(best_row[0], rows)


def _as_column(y: Float, road: LearningRoad, frames: Frames) -> Float:
    """Return y values (N,) as the one column of a prediction."""
    return y[:, None]


def road_table(measured: Measured, roads: Mapping[str, str], columns: tables.Columns = ROAD_COLUMNS) -> str:
    """Return a Markdown table of all predictors with some columns per road.

    Args:
        measured: the figures.
        roads: title of each road to be shown, by name.
        columns: of each road.
    """
    head = ["", *(f"{title}: {metric.title}" for title in roads.values() for metric in columns.values())]
    body = [
        [
            name,
            *(
                tables.cell(rows.get(road, {}).get(figure), metric)
                for road in roads
                for figure, metric in columns.items()
            ),
        ]
        for name, rows in measured.items()
    ]
    return markdown(head, body)


class RememberingPredictor(CenterlinePredictor):
    """A centreline predictor that caches its results by points and frames.

    Those that `calibrate` makes of it share its memory.
    """

    memory: dict[str, tuple[Float, Float]]

    def _combine_sequences(self, road: LearningRoad, frames: Frames) -> tuple[Float, Float]:
        """Return the prediction and its deviations, from memory if the same points and frames came before."""
        parts = (road.xyz, road.intensity, frames.position, frames.direction)
        key = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()
        if key not in self.memory:
            self.memory[key] = super()._combine_sequences(road, frames)
        return self.memory[key]


def remembering(predictor: CenterlinePredictor) -> RememberingPredictor:
    """Return a caching copy of a centreline predictor, with an empty cache."""
    remembering_predictor = RememberingPredictor(
        predictor.model, predictor.settings, predictor.use, predictor.calibration
    )
    remembering_predictor.memory = {}
    return remembering_predictor


def load_models(runs: Sequence[str]) -> dict[str, list[Model]]:
    """Load trained runs given as NAME=FOLDER; return models by name, merging those of one truth and real roads."""
    predictors_of_name: dict[str, dict[tuple[TruthKind, frozenset[str], float], list[Predictor]]] = {}
    for text in runs:
        name, _, folder = text.partition("=")
        run = Run.open(Path(folder))
        predictor = remembering(import_module("ml.centerline.task").load_predictor(run))
        model_key = (kind_of(run), learned_by(run), _part(run, SliceSettings).half_width)
        predictors_of_name.setdefault(name, {}).setdefault(model_key, []).append(predictor)
    return {
        name: [Model(kind, versions, learned, width) for (kind, learned, width), versions in versions_of_key.items()]
        for name, versions_of_key in predictors_of_name.items()
    }


def kind_of(run: Run[Any]) -> TruthKind:
    """Return the kind of truth, road or carriageway, that a run learned; road if it learned both."""
    return "carriageway" if _part(run, SliceSettings).truth == "carriageway" else "road"


def learned_by(run: Run[Any]) -> frozenset[str]:
    """Return the names of the real roads that a run, or one that it began with, was trained or validated on."""
    data, start_run = _part(run, DataOptions), run.configuration.begin_with
    own_roads = frozenset(Path(road.cloud).stem for road in (*data.measured, *data.measured_validation))
    return own_roads | learned_by(Run.open(Path(start_run))) if start_run else own_roads


def _part(run: Run[Any], kind: type[AnyPart]) -> AnyPart:
    """Return the part of a run's configuration that is of a class."""
    parts = (getattr(run.configuration, name) for name in type(run.configuration).model_fields)
    return next(part for part in parts if isinstance(part, kind))


def of_kind(
    models_of_name: Mapping[str, Sequence[Model]], kind: TruthKind, seeds: int, road: str = ""
) -> dict[str, list[Predictor]]:
    """Return by name the predictors that learned one kind of truth and not the named road: one, or one per seed.

    Without a road, as for synthetic ones, all versions of a name count, and the first of them are taken.
    """
    predictors_of_name: dict[str, list[Predictor]] = {}
    for name, models in models_of_name.items():
        fitting_versions = [model.versions for model in models if model.kind == kind and road not in model.learned]
        if len(fitting_versions) > 1 and road:
            raise SystemExit(
                f"--run {name}: {len(fitting_versions)} models that know other real roads than {road}; name them apart"
            )
        if fitting_versions:
            predictors_of_name[name] = fitting_versions[0]
    for name, versions in predictors_of_name.items():
        if len(versions) not in (1, seeds):
            raise SystemExit(f"--run {name}: {len(versions)} runs for {seeds} seeds; give one run or one per seed")
    return predictors_of_name


def seen_by(models_of_name: Mapping[str, Sequence[Model]], kind: TruthKind) -> float:
    """Return the largest half-width (m) of the slices of the models of one kind of truth, for the baselines."""
    widths = [model.half_width for models in models_of_name.values() for model in models if model.kind == kind]
    return max(widths, default=HALF_WIDTH)


def baselines(search: GridSearch, half_width: float = HALF_WIDTH) -> dict[str, list[Predictor]]:
    """Return the untrained predictors by name: the skeleton with the best and the reference settings, trivial ones."""
    best_settings = search.best
    reference_settings = replace(REFERENCE, mask=best_settings.mask)
    tuned_name, plain_name = (
        f"skeleton, {settings.raster:g} m, {settings.branch:g} m, {settings.bin:g} m"
        for settings in (best_settings, reference_settings)
    )
    tuned_name = f"{tuned_name} (tuned)"
    return {
        tuned_name: [skeleton_predictor(best_settings)],
        plain_name: [skeleton_predictor(reference_settings)],
        **trivial_predictors(half_width),
    }


def synthetic_roads(texts: Sequence[str], kind: TruthKind) -> list[LearningRoad]:
    """Read the roads of data sets given as FOLDER or FOLDER:SPLIT (test if not given)."""
    parts = [text.partition(":") for text in texts]
    scenes = [scene for folder, _, split in parts for scene in scene_folders(Path(folder), split or "test")]
    return [road for scene in scenes for road in read_scene(scene, kind)]


def search_settings(cases: Sequence[Case], masks: Sequence[str], file: Path) -> GridSearch:
    """Run the skeleton baseline's grid search and write its settings and figures to a JSON file; return it."""
    search = grid_search(cases, masks)
    rows = [{"raster": s.raster, "branch": s.branch, "mask": s.mask, "bin": s.bin, **row} for s, row in search.rows]
    text = json.dumps({"best": vars(search.best), "road": cases[0].road.name, "tried": rows}, indent=1)
    write_file(file, text.encode(), overwrite=True)
    return search


def shown_by(roads: Sequence[LearningRoad], cropping: Cropping | None, estimated: bool) -> Callable[[int], list[Case]]:
    """Return a function from a seed to the roads' evaluation cases."""
    return lambda seed: [make_case(road, seed, cropping=cropping, estimated=estimated) for road in roads]


def synthetic_tables(arguments: argparse.Namespace, models_of_name: Mapping[str, Sequence[Model]]) -> dict[str, str]:
    """Measure on the synthetic data sets; return the document's Markdown tables by name."""
    result: dict[str, str] = {}
    for kind in arguments.truths:
        if arguments.in_domain:
            result |= in_domain(arguments, models_of_name, kind)
        if arguments.other:
            result |= other_scanners(arguments, models_of_name, kind)
    return result


def in_domain(
    arguments: argparse.Namespace, models_of_name: Mapping[str, Sequence[Model]], kind: TruthKind
) -> dict[str, str]:
    """Measure on roads of the training's scanner, write tables and pictures; return Markdown tables by name."""
    name, roads = f"in-domain-{kind}", synthetic_roads(arguments.in_domain, kind)
    cases = shown_by(roads, None, estimated=False)
    search = search_settings(cases(arguments.seeds[0])[:1], ["classes"], arguments.output / f"skeleton-{name}.json")
    predictors_of_name = of_kind(models_of_name, kind, len(arguments.seeds))
    figures = measure(predictors_of_name | baselines(search, seen_by(models_of_name, kind)), cases, arguments.seeds)
    tables.write_tables(arguments.output, name, figures)
    if kind == arguments.truths[-1]:
        draw_synthetic(arguments, roads[-1], predictors_of_name, search)
    return {name: tables.table(figures)} | corridor_table(arguments, name, predictors_of_name, cases)


def other_scanners(
    arguments: argparse.Namespace, models_of_name: Mapping[str, Sequence[Model]], kind: TruthKind
) -> dict[str, str]:
    """Measure on roads of other scanners and write tables; return Markdown tables by name, columns per scanner."""
    name, predictors_of_name = f"{OTHER}-{kind}", of_kind(models_of_name, kind, len(arguments.seeds))
    texts_to_recalibrate, texts_of_title = by_title(arguments.recalibrate), by_title(arguments.other)
    roads = {title: synthetic_roads(texts, kind) for title, texts in texts_of_title.items()}
    all_cases = shown_by([road for scanner_roads in roads.values() for road in scanner_roads], None, estimated=False)
    search = search_settings(all_cases(arguments.seeds[0])[:1], ["classes"], arguments.output / f"skeleton-{name}.json")
    all_predictors = predictors_of_name | baselines(search, seen_by(models_of_name, kind))
    figures: Measured = {}
    for title, scanner_roads in roads.items():
        recalibrated_predictors = (
            recalibrated(arguments.seeds, predictors_of_name, synthetic_roads(texts_to_recalibrate[title], kind))
            if title in texts_to_recalibrate
            else {}
        )
        scanner_figures = measure(
            all_predictors | recalibrated_predictors, shown_by(scanner_roads, None, estimated=False), arguments.seeds
        )
        for predictor, rows in scanner_figures.items():
            figures.setdefault(predictor, {})[title] = rows["all"]
    tables.write_tables(arguments.output, name, figures)
    titles = {title: title for title in texts_of_title}
    rows_with_coverage = {
        predictor: rows for predictor, rows in figures.items() if any("coverage_68" in row for row in rows.values())
    }
    distance_rows = {predictor: rows for predictor, rows in figures.items() if predictor in all_predictors}
    table_texts = {name: road_table(distance_rows, titles)}
    if rows_with_coverage:
        table_texts[f"coverage-{name}"] = road_table(rows_with_coverage, titles, COVERAGE_COLUMNS)
    return table_texts | corridor_table(arguments, name, predictors_of_name, all_cases)


def by_title(texts: Sequence[str]) -> dict[str, list[str]]:
    """Return the FOLDER[:SPLIT] texts of arguments TITLE=FOLDER[:SPLIT] by title; exit if one isn't of that form."""
    texts_of_title: dict[str, list[str]] = {}
    for text in texts:
        title, equals, folder = text.partition("=")
        if not equals:
            raise SystemExit(f"{text}: must be TITLE=FOLDER or TITLE=FOLDER:SPLIT")
        texts_of_title.setdefault(title, []).append(folder)
    return texts_of_title


def recalibrated(
    seeds: Sequence[int], predictors_of_name: Mapping[str, Sequence[Predictor]], roads: Sequence[LearningRoad]
) -> dict[str, list[Predictor]]:
    """Return copies of the models with deviations recalibrated on some roads, by "NAME, recalibrated"."""
    recalibrated_predictors: dict[str, list[Predictor]] = {}
    for name, versions in predictors_of_name.items():
        for seed, version in zip(seeds, versions, strict=False):
            cases = [make_case(road, seed, cropping=None, estimated=False) for road in roads]
            new_version, _ = version.calibrate((case.road, case.frames) for case in cases)  # type: ignore[attr-defined]
            recalibrated_predictors.setdefault(f"{name}, recalibrated", []).append(new_version)
    return recalibrated_predictors


def corridor_table(
    arguments: argparse.Namespace,
    name: str,
    predictors_of_name: Mapping[str, Sequence[Predictor]],
    cases: Callable[[int], Sequence[Case]],
) -> dict[str, str]:
    """Measure the models' corridors and write tables; return one Markdown table by name, none without models."""
    if not predictors_of_name:
        return {}
    corridor = measure_corridor(predictors_of_name, cases, arguments.seeds)
    tables.write_tables(arguments.output, f"corridor-{name}", corridor)
    return {f"corridor-{name}": tables.table(corridor, columns=tables.CORRIDOR_COLUMNS)}


def measure_corridor(
    predictors_of_name: Mapping[str, Sequence[Predictor]], cases: Callable[[int], Sequence[Case]], seeds: Sequence[int]
) -> Measured:
    """Return mean errors and coverage of each corridor target over seeds, by "MODEL: TARGET"."""
    corridor_figures = import_module("ml.centerline.measuring").corridor_figures
    rows: dict[str, list[dict[str, float]]] = {}
    for index, seed in enumerate(seeds):
        seed_cases = cases(seed)
        for name, versions in predictors_of_name.items():
            figures_of_target = corridor_figures(versions[min(index, len(versions) - 1)], seed_cases)
            for target, figures in figures_of_target.items():
                title = f"{name}: {tables.TARGETS_SHOWN[target][0]}"
                rows.setdefault(title, []).append(tables.shown_figures(target, figures))
    return {name: {"all": over_seeds(values)} for name, values in rows.items()}


def real_tables(arguments: argparse.Namespace, models_of_name: Mapping[str, Sequence[Model]]) -> dict[str, str]:
    """Measure on the real roads, cropped in several ways, write tables; return Markdown tables by name."""
    if arguments.real is None:
        return {}
    roads = {
        name: read_measured(arguments.real / f"{name}.laz", arguments.real / f"{name}_axis.csv", kind)
        for name, (_, kind) in REAL_ROADS.items()
    }
    titles = {name: title for name, (title, _) in REAL_ROADS.items()}
    result = {}
    for table, cropping in CROPPINGS.items():
        tuning_case = make_case(roads[TUNED_ON], arguments.seeds[0], cropping=cropping, estimated=True)
        search = search_settings([tuning_case], ["ground", "dark"], arguments.output / f"skeleton-{table}.json")
        figures = measure_real(arguments.seeds, roads, cropping, models_of_name, search)
        tables.write_tables(arguments.output, table, figures)
        result[table] = road_table(figures, titles)
        if table == "real-slices":
            draw_real(arguments, roads[TUNED_ON], models_of_name, search)
            painted_figures = measure_painted(arguments.seeds, roads[PAINTED], cropping, models_of_name, search)
            tables.write_tables(arguments.output, "real-painted", painted_figures)
            result["real-painted"] = tables.table(painted_figures)
    return result


def measure_painted(
    seeds: Sequence[int],
    road: LearningRoad,
    cropping: Cropping | None,
    models_of_name: Mapping[str, Sequence[Model]],
    search: GridSearch,
) -> Measured:
    """Return the figures of all predictors and of the measured axis against the painted line beside it."""
    line, kind = with_painted_line(road), REAL_ROADS[road.name][1]
    predictors = of_kind(models_of_name, kind, len(seeds), road.name) | baselines(search, seen_by(models_of_name, kind))
    predictors["the measured axis"] = [axis_predictor(road)]
    return measure(
        predictors,
        # The same points and frames as against the axis.
        lambda seed: [
            Case(replace(case.road, truth=line.truth), case.frames)
            for case in shown_by([road], cropping, estimated=True)(seed)
        ],
        seeds,
    )


def axis_predictor(measured_road: LearningRoad) -> Predictor:
    """Return a predictor that gives a road's measured axis as the centre."""
    return lambda road, frames: measured_road.known_truth.axis.crossing(frames.position, frames.direction)[0][:, None]


def measure_real(
    seeds: Sequence[int],
    roads: Mapping[str, LearningRoad],
    cropping: Cropping | None,
    models_of_name: Mapping[str, Sequence[Model]],
    search: GridSearch,
) -> Measured:
    """Return the figures of all predictors on the real roads of their kind of truth that they didn't learn from."""
    all_figures: Measured = {name: {} for name in (*models_of_name, *baselines(search))}
    for road, (_, kind) in REAL_ROADS.items():
        predictors = of_kind(models_of_name, kind, len(seeds), road) | baselines(search, seen_by(models_of_name, kind))
        figures = measure(predictors, shown_by([roads[road]], cropping, estimated=True), seeds)
        for name, rows in figures.items():
            all_figures[name][road] = rows[road]
    return {name: rows for name, rows in all_figures.items() if rows}


def draw_synthetic(
    arguments: argparse.Namespace, road: LearningRoad, versions: Mapping[str, Sequence[Predictor]], search: GridSearch
) -> None:
    """Write pictures of centrelines and of one corridor over a synthetic road."""
    case = make_case(road, arguments.seeds[0], cropping=None, estimated=False)
    predictors = {name: predictor_versions[0] for name, predictor_versions in versions.items()}
    view = middle_view(road, 160.0)
    draw_lines(
        arguments.pictures / "centerline-lines.png", case, predictors, search, view, f"synthetic road {road.name}"
    )
    if predictors:
        name = arguments.corridor or list(predictors)[-1]
        prediction = predictors[name](case.road, case.frames)
        picture = pictures.corridor_picture(case, prediction, view, f"{name}: corridor of the road {road.name}", 24.0)
        write_file(arguments.pictures / "centerline-corridor.png", picture, overwrite=True)


def draw_real(
    arguments: argparse.Namespace, road: LearningRoad, models_of_name: Mapping[str, Sequence[Model]], search: GridSearch
) -> None:
    """Write a picture of centrelines over a real road with cropped slices."""
    kind = REAL_ROADS[road.name][1]
    case = make_case(road, arguments.seeds[0], cropping=CROPPINGS["real-slices"], estimated=True)
    versions_of_name = of_kind(models_of_name, kind, len(arguments.seeds), road.name)
    predictors = {name: predictor_versions[0] for name, predictor_versions in versions_of_name.items()}
    title = f"real road, {REAL_ROADS[road.name][0]}, both sides of every slice cropped"
    path = arguments.pictures / "centerline-real.png"
    draw_lines(path, case, predictors, search, middle_view(road, 160.0), title)


def draw_lines(
    path: Path,
    case: Case,
    predictors: Mapping[str, Predictor],
    search: GridSearch,
    view: pictures.PictureView,
    title: str,
) -> None:
    """Write a picture of the learned lines, the tuned skeleton and the middle of the extent over a road."""
    tuned_entry, _, *_ = baselines(search).items()
    trivial_entry = ("middle of the extent", trivial_predictors()["middle of the extent"])
    lines = {name: predictor(case.road, case.frames)[:, 0] for name, predictor in predictors.items()}
    for name, predictor_versions in (tuned_entry, trivial_entry):
        lines[name] = predictor_versions[0](case.road, case.frames)[:, 0]
    height = 24.0 if case.road.truth is not None and case.road.truth.left is not None else 6.0
    write_file(path, pictures.lines_picture(case, lines, view, title, height), overwrite=True)


def middle_view(road: LearningRoad, length: float) -> pictures.PictureView:
    """Return the view of `length` (m) in the middle of a road."""
    whole_length = road.reference.length
    return pictures.PictureView(
        max(0.0, (whole_length - length) / 2.0), min(whole_length, (whole_length + length) / 2.0)
    )


def arguments_of(words: Sequence[str] | None) -> argparse.Namespace:
    """Return the parsed arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", action="append", default=[], metavar="NAME=FOLDER", help="a trained run (repeatable)")
    parser.add_argument(
        "--in-domain", nargs="+", metavar="FOLDER[:SPLIT]", help="data sets of the scanner that was trained on"
    )
    parser.add_argument(
        "--other", action="append", default=[], metavar="TITLE=FOLDER[:SPLIT]", help="data set of another scanner"
    )
    parser.add_argument(
        "--recalibrate",
        action="append",
        default=[],
        metavar="TITLE=FOLDER[:SPLIT]",
        help="further roads of another scanner, to find factors on deviations",
    )
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="real scans with their axes")
    text = "what is to be found on synthetic roads (all); corridor and lines are drawn for the last"
    parser.add_argument("--truths", nargs="+", choices=TRUTH_KINDS, default=["carriageway", "road"], help=text)
    parser.add_argument("--corridor", metavar="NAME", help="the model whose corridor is drawn (the last)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5], help="of paths, cuts and runs")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder for the tables as JSON")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="folder for the pictures (--output)")
    parser.add_argument("--document", type=Path, metavar="FILE", help="Markdown whose tables are replaced")
    arguments = parser.parse_args(words)
    arguments.pictures = arguments.pictures or arguments.output
    return arguments


def expected_tables(arguments: argparse.Namespace) -> list[str]:
    """Return the names of the tables that the arguments ask for."""
    names = [f"in-domain-{kind}" for kind in arguments.truths if arguments.in_domain]
    others = [f"{OTHER}-{kind}" for kind in arguments.truths if arguments.other]
    if arguments.run:
        others += [f"coverage-{name}" for name in others]
        names += [f"corridor-{name}" for name in (*names, *others) if not name.startswith("coverage")]
    return names + others + ([*CROPPINGS, "real-painted"] if arguments.real else [])


def measured_tables(arguments: argparse.Namespace) -> dict[str, str]:
    """Measure on all data that are given; return the document's Markdown tables by name."""
    models_of_name = load_models(arguments.run)
    return synthetic_tables(arguments, models_of_name) | real_tables(arguments, models_of_name)


def main(words: Sequence[str] | None = None) -> None:
    """Measure as the command line says, fill the document's tables and print them."""
    arguments = arguments_of(words)
    try:
        texts = put_tables(arguments.document, expected_tables(arguments), lambda: measured_tables(arguments))
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    for name, text in texts.items():
        print(f"{name}\n\n{text}")


if __name__ == "__main__":
    main()
