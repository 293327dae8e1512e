"""Measure the smallest change of each kind that is found between two surveys, by UAV, vehicle and aircraft.

    python studies/changes/smallest.py --output out/smallest
    python studies/changes/smallest.py --output out/smallest --sensors mobile --print

Each kind is planted at several sizes on a road of 80 m (`planted.py`), which is surveyed before and after. A point of
either epoch is called changed by two measures:

- M3C2's distance to the other epoch (py4dgeo, both ways); where nothing of that is within M3C2's reach, the distance to
  its nearest point.
- On pavement, the difference of the medians of the intensities of the eight nearest points of either epoch, as
  logarithms; of worn paint, that of the eight nearest points of markings.

Their thresholds are calibrated on a road on which nothing changes, so that one of a hundred points is a false alarm: on
pavement, markings, plants and everything else each for itself. A size is found where more than half of its points are;
the smallest is that from which on all larger ones are found. In brackets stands what is noticed: more than a tenth of
its points are found, ten times as many as of unchanged ones, as the post of a turned sign stays where it was.

`as surveyed` has the errors of trajectories and strips, different in both epochs; `registered` is without them. What is
in the output folder isn't measured again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.changes.planted import KINDS, ROADS, PlantedPair, Series, planted_pair, still_pair  # noqa: E402
from synthroads_addon import load_scenario  # noqa: E402
from synthroads_addon.base.arrays import AnyArray, Bool, Float  # noqa: E402
from synthroads_addon.base.classes import class_id  # noqa: E402
from synthroads_addon.comparison.epochs.detectors import DEPTH, DetectorSettings, m3c2  # noqa: E402
from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs  # noqa: E402
from synthroads_addon.jobs.generate import Job  # noqa: E402
from synthroads_addon.scanning.epochs.truth import MOBILE, UNCHANGED  # noqa: E402
from synthroads_addon.scenario.scenario import Scenario  # noqa: E402
from synthroads_addon.scenario.without import scenario_without  # noqa: E402

SENSORS = {"mobile": "mobile-mapping-300m", "UAV": "rq31-600m", "airborne": "airborne-1000m"}
"""Sensor -> the shipped scenario whose scan it is."""
RADII = {"mobile": 0.25, "UAV": 0.25, "airborne": 0.5}
"""Radius of M3C2's cylinders by sensor, m: an aircraft's cloud is sparse."""
SURVEYS = ("registered", "as surveyed")
FALSE_ALARMS, FOUND, NOTICED = 0.01, 0.5, 0.1
"""Share of unchanged points beyond a threshold; shares of a change's points beyond it with which it is found, and with
which it is noticed: ten times as many as of unchanged ones."""
GROUPS = ("road", "road_marking", "vegetation", "other")
"""Classes that have a threshold of their own; the last is all others."""
MEASURES, PAINT = ("M3C2", "intensity"), ("paint",)
"""Measures of all kinds but worn paint, and of that."""
STILL_NAMES = {MEASURES: "still", PAINT: "still-paint"}
"""Names of the files of their thresholds."""
FEWEST = 5
"""Points that a size must have in both clouds to be judged."""
FAINTEST = 1e-15
"""Least intensity whose logarithm is taken: an aircraft's are 1e-7 and less."""
_NEIGHBOURS = 8
_SETTINGS = (
    "fidelity=draft",
    "colour.source=nodes",
    "colour.intensity_from_layers=always",
    "colour.rgb=false",
    "vegetation_detail=0.5",
    'outputs=["parameters","cloud"]',
    'cloud.formats=["npz"]',
)


@dataclass(frozen=True)
class Survey:
    """Points of one epoch that a detector is judged by.

    Attributes:
        xyz: (N, 3) map coordinates, m.
        log_intensity: (N,) natural logarithm.
        group: (N,) place in `GROUPS`.
        number: (N,) number of the change; 0 of none.
        is_unchanged: (N,) whether they are called that.
    """

    xyz: Float
    log_intensity: Float
    group: AnyArray
    number: AnyArray
    is_unchanged: Bool

    @property
    def is_paved(self) -> Bool:
        """Return which points (N,) are of pavement and markings."""
        return np.asarray(self.group < 2)

    @classmethod
    def read(cls, folder: Path) -> Survey:
        """Return the points of an epoch's folder, without traffic and what the epoch before couldn't see."""
        with np.load(folder / "cloud.npz") as data:
            kept = (data["change"] != MOBILE) & (data["not_seen_before"] == 0)
            group = np.full(len(kept), len(GROUPS) - 1)
            for place, name in enumerate(GROUPS[:-1]):
                group[data["class_id"] == class_id(name)] = place
            return cls(
                data["xyz"][kept],
                np.log(np.maximum(data["intensity"][kept], FAINTEST)),
                group[kept],
                data["change_id"][kept],
                data["change"][kept] == UNCHANGED,
            )


def sensor_scenario(sensor: str, survey: str) -> Scenario:
    """Return the scenario of a survey by a sensor, with the errors of trajectories and strips or without."""
    scenario = load_scenario(SENSORS[sensor], list(_SETTINGS))
    if survey == "as surveyed":
        return scenario
    still = {"position_sigma": 0.0, "attitude_sigma_deg": 0.0, "heading_sigma_deg": 0.0}
    noise = scenario.scan.noise.model_copy(update=still)
    scan = scenario.scan.model_copy(update={"noise": noise})
    return scenario_without(scenario.model_copy(update={"scan": scan}), ["strip-errors"])


def survey_pair(pair: PlantedPair, scenario: Scenario, folder: Path) -> tuple[Survey, Survey]:
    """Return both epochs of a planted road as surveyed; their files go to a folder."""
    parameters = folder / "before.json"
    parameters.write_text(pair.before.to_json(), encoding="utf-8")
    job = Job(scenario, folder / "epochs", parameters=parameters, new_file=True)
    generate_epochs(EpochsJob(job, changes=(pair.changes,)))
    first, second = (Survey.read(folder / "epochs" / f"epoch-{number}") for number in (1, 2))
    return first, second


def geometric_scores(own: Survey, other: Survey, radius: float) -> Float:
    """Return the sizes (N,), m, of M3C2's distances from points to another epoch; 0 where there is none.

    Where that has no points within M3C2's reach, it is the distance to its nearest one.
    """
    score = np.abs(m3c2(other.xyz, own.xyz, DetectorSettings(radius)).distance)
    rows = np.flatnonzero(np.isnan(score))
    distance, _ = cKDTree(other.xyz).query(own.xyz[rows])
    score[rows] = np.where(distance >= DEPTH, distance, 0.0)
    return score


def intensity_scores(own: Survey, other: Survey, is_of_paint: bool) -> Float:
    """Return the sizes (N,) of the differences of median logarithms of intensities on pavement, 0 beside it.

    What all of the pavement differs by is taken off them: the gain of another day.

    Args:
        own, other: the epoch of the points, and the other one.
        is_of_paint: whether points of markings are compared with those alone, and no others at all.
    """
    score = np.zeros(len(own.xyz))
    if not is_of_paint:
        score[own.is_paved] = np.abs(_differences(own, other, own.is_paved, other.is_paved))
    else:
        own_paint, other_paint = (epoch.group == GROUPS.index("road_marking") for epoch in (own, other))
        gain = np.median(own.log_intensity[own.group == 0]) - np.median(other.log_intensity[other.group == 0])
        score[own_paint] = np.abs(_differences(own, other, own_paint, other_paint, float(gain)))
    return score


def _differences(own: Survey, other: Survey, of_own: Bool, of_other: Bool, gain: float | None = None) -> Float:
    """Return the differences (K,) of the medians around chosen points of an epoch, less a gain or their own median.

    Args:
        own, other: the epoch of the points, and the other one.
        of_own, of_other: which of their points are looked at.
        gain: what the other epoch is weaker by.
    """
    places = own.xyz[of_own]
    medians = []
    for epoch, chosen in ((own, of_own), (other, of_other)):
        _, nearest = cKDTree(epoch.xyz[chosen]).query(places, k=_NEIGHBOURS)
        medians.append(np.median(epoch.log_intensity[chosen][nearest], axis=1))
    difference = medians[0] - medians[1]
    return np.asarray(difference - (np.median(difference) if gain is None else gain))


Figures = dict[str, Any]
"""By measure: of the unchanged road its thresholds by group, of another one the shares found by kind and size."""


def scores_of(
    pair: PlantedPair, sensor: str, survey: str, measures: Sequence[str]
) -> tuple[tuple[Survey, Survey], dict[str, Float]]:
    """Return both epochs of a planted road, and by measure the scores of the points of the first and the second."""
    with tempfile.TemporaryDirectory() as folder:
        first, second = survey_pair(pair, sensor_scenario(sensor, survey), Path(folder))
    result = {}
    for name in measures:
        scores = [
            geometric_scores(own, other, RADII[sensor])
            if name == "M3C2"
            else intensity_scores(own, other, name == "paint")
            for own, other in ((first, second), (second, first))
        ]
        result[name] = np.concatenate(scores)
    return (first, second), result


def thresholds(sensor: str, survey: str, measures: Sequence[str]) -> Figures:
    """Return the thresholds by measure and group, by a road on which nothing changes, as JSON data."""
    epochs, scores = scores_of(still_pair(), sensor, survey, measures)
    group = np.concatenate([epoch.group for epoch in epochs])
    return {
        name: {
            of_group: float(np.quantile(score[group == place], 1.0 - FALSE_ALARMS))
            for place, of_group in enumerate(GROUPS)
        }
        for name, score in scores.items()
    }


def measure(road: str, sensor: str, survey: str, limits: Mapping[str, Mapping[str, float]]) -> Figures:
    """Return the shares found of the changes on a road, by measure, kind and size, as JSON data.

    Args:
        road: its name.
        sensor, survey: by which it is surveyed.
        limits: thresholds by measure and group.
    """
    pair = planted_pair(road, ROADS[road])
    epochs, scores = scores_of(pair, sensor, survey, tuple(limits))
    group, number, is_unchanged = (
        np.concatenate([getattr(epoch, name) for epoch in epochs]) for name in ("group", "number", "is_unchanged")
    )
    result: Figures = {}
    for name, score in scores.items():
        limit = np.array([limits[name][of_group] for of_group in GROUPS])[group]
        # Off the pavement no intensities are compared.
        found = (score > limit) & ((group < 2) | (name == "M3C2"))
        for kind, size in sorted(set(pair.planted)):
            numbers = [
                change.number
                for change, planted in zip(pair.changes.changes, pair.planted, strict=True)
                if planted == (kind, size)
            ]
            rows = np.isin(number, numbers) & ~is_unchanged
            share = round(float(found[rows].mean()), 4) if rows.sum() >= FEWEST else None
            row = {"points": int(rows.sum()), "found": share}
            result.setdefault(name, {}).setdefault(kind, {})[str(size)] = row
    return result


def smallest(sizes: Mapping[str, Mapping[str, Any]], share: float) -> float | None:
    """Return the smallest size from which on more than a share of the points of all larger ones are; None if none."""
    result = None
    for size, row in sorted(((float(size), row) for size, row in sizes.items()), reverse=True):
        if row["found"] is None or row["found"] <= share:
            break
        result = size
    return result


def cell(many: list[Series], files: list[Path]) -> str:
    """Return what the table says of a kind by a sensor: the smallest size by M3C2 and by intensity, or that none is.

    Args:
        many: the kind's series.
        files: figures of its roads.
    """
    if not all(path.is_file() for path in files):
        return ""
    texts = []
    figures = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    for name in figures[0]:
        sizes: dict[str, Any] = {}
        for figure in figures:
            sizes.update(figure[name][many[0].kind])
        found, noticed = (_text(many[0], sizes, share) for share in (FOUND, NOTICED))
        texts.append(found if found == noticed else f"{found} ({noticed})")
    return " / ".join(texts if len(texts) > 1 else ["", *texts])


def _text(series: Series, sizes: Mapping[str, Mapping[str, Any]], share: float) -> str:
    """Return the smallest size of which more than a share of the points are found, as text; a dash for none."""
    size = smallest(sizes, share)
    if size is None:
        return "-"
    return "yes" if len(sizes) == 1 else f"{series.factor * size:g}"


def table(folder: Path) -> Iterator[str]:
    """Yield the lines of the table of what is in a folder."""
    columns = [(survey, sensor) for survey in SURVEYS for sensor in SENSORS]
    yield "| kind | size | " + " | ".join(f"{sensor}, {survey}" for survey, sensor in columns) + " |"
    yield "|---" * (2 + len(columns)) + "|"
    for kind in KINDS:
        roads = {name: series for name, many in ROADS.items() for series in many if series.kind == kind}
        many = list(roads.values())
        texts = [
            cell(many, [result_path(folder, name, sensor, survey) for name in roads]) for survey, sensor in columns
        ]
        unit = f", {many[0].unit}" if many[0].unit else ""
        yield f"| {kind} | {many[0].what}{unit} | {' | '.join(texts)} |"


def result_path(folder: Path, road: str, sensor: str, survey: str) -> Path:
    """Return the file of the figures of a road by a sensor."""
    return folder / f"{sensor}-{survey.replace(' ', '-')}-{road}.json"


def kept(path: Path, make: Callable[[], Figures]) -> Figures:
    """Return the figures of a file, made and written if it isn't there."""
    if not path.is_file():
        figures = make()
        path.write_text(json.dumps(figures, indent=1), encoding="utf-8")
        print(path.stem, file=sys.stderr, flush=True)
    return dict(json.loads(path.read_text(encoding="utf-8")))


def main() -> None:
    """Measure what isn't there yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="folder of the figures")
    parser.add_argument("--roads", nargs="+", choices=list(ROADS), default=list(ROADS))
    parser.add_argument("--sensors", nargs="+", choices=list(SENSORS), default=list(SENSORS))
    parser.add_argument("--surveys", nargs="+", choices=SURVEYS, default=list(SURVEYS))
    parser.add_argument("--print", action="store_true", help="print the table of what is there, and measure nothing")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    for survey, sensor in [] if options.print else product(options.surveys, options.sensors):
        for road in options.roads:
            measures = PAINT if road.startswith("worn") else MEASURES
            still = result_path(options.output, STILL_NAMES[measures], sensor, survey)
            limits = kept(still, partial(thresholds, sensor, survey, measures))
            path = result_path(options.output, road, sensor, survey)
            kept(path, partial(measure, road, sensor, survey, limits))
    print("\n".join(table(options.output)))


if __name__ == "__main__":
    main()
