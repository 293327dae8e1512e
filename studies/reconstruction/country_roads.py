"""Print how country roads come back from their clouds: axis, lanes, class, cross-section, doubt, rules broken.

python studies/reconstruction/country_roads.py out/country                      # 60 roads, pavement and paint by class
python studies/reconstruction/country_roads.py out/country --without-classes    # the same told by brightness
python studies/reconstruction/country_roads.py out/country --document docs/reconstruction.md

Each cross-section of the RAL and of the older, narrower roads by turns; of four of each one has worn lines, one none at
all. Blender scans the first ones (--scanned) as an aircraft would, with sway, strips and noise of the scenario
country-600m; of the others points are thrown evenly onto the analytic road. Each road has a folder with its parameters,
its cloud and what was measured; what is there already isn't made again, so that several processes may share the work
(--part 1 2, --part 2 2).
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.marked_documents import put_tables  # noqa: E402
from synthroads_addon.base.classes import class_id  # noqa: E402
from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.checking.checker import check  # noqa: E402
from synthroads_addon.reconstruction.cloud import SURFACE, PointKind, RoadCloud, read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.comparison import compare  # noqa: E402
from synthroads_addon.reconstruction.reconstruct import Reconstruction, reconstruct  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.road.guidelines import GUIDELINES, design_class_of  # noqa: E402
from synthroads_addon.road.parameters import RoadParameters, read_parameters  # noqa: E402
from synthroads_addon.road.section import Carriageway, LineMarking  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402
from tests.helpers.clouds.road_clouds import cloud_of, write  # noqa: E402

SECTIONS = tuple(
    name for guideline in GUIDELINES.values() if guideline.carriageways == 1 for name in guideline.sections
)
"""Cross-sections of one carriageway."""
LINES = ("fresh", "worn", "fresh", "none")
"""How the lines of the first, second, ... road of a cross-section are."""
_LENGTH = 250.0
"""Length of each road, m."""
_SETTINGS = (
    f"road.length={_LENGTH}",
    "road.half_width=20",
    "road.grass_density=0.2",
    "road.landscape.reach=300",
    'outputs=["cloud"]',
    "cloud.attributes=[]",
    "scan.platform.path=direct",
    "scan.platform.lateral_offsets=[-45,130]",
)
"""Settings of every scan beside those of the scenario country-600m: as little beside the road as its edges need, and
strips beside the centreline, within the least radius of all classes."""
_WORN = ('road.materials.paint_wear={"minimum":0.5,"maximum":0.75}',)
"""Settings of roads with worn lines: the scenario's own are worn by a tenth to a third."""
_FIRST_SEED = 4100
_THROWN = 12.0
"""Points per m2 of roads that aren't scanned."""
_PATCH, _LEFT = 3.0, (0.1, 0.7)
"""Length, m, on which lines of thrown roads are worn alike, and shares of the paint that are left there."""
_RIGHT, _SILENT = 0.3, 1.0
"""Errors of the axis, m, below which it is right, and above which it must be doubted."""
_LATERAL_REACH = 5.0
"""Distance between the axes, m, beyond which a station is taken to be none of the road."""


@dataclass(frozen=True)
class Figures:
    """Figures of one road.

    Attributes:
        refused: whether nothing was made of it.
        length: of the true road, m.
        mean, largest: error of the axis, m; NaN where it was refused.
        lanes: share of the length, over both sides, on which the number of lanes is right.
        near, silent, doubted: lengths, m, on which the axis is within 0.3 m; over 1 m off and not doubted; doubted
            though within 0.3 m.
        section, design_class, lines: whether the nearest standard cross-section, the class, and the lines between the
            directions are the true ones.
        rules: rules that the result breaks and the true road doesn't.
        reasons: reasons of doubts.
    """

    refused: str
    length: float
    mean: float
    largest: float
    lanes: float
    near: float
    silent: float
    doubted: float
    section: bool
    design_class: bool
    lines: bool
    rules: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()


def section_of(number: int) -> tuple[str, str]:
    """Return the cross-section and how the lines are of a road by its number."""
    return SECTIONS[number % len(SECTIONS)], LINES[number // len(SECTIONS) % len(LINES)]


def make(number: int, folder: Path, is_scanned: bool, seed: int = _FIRST_SEED) -> tuple[RoadParameters, Path]:
    """Return a road's true parameters and its cloud, sampled, and scanned by Blender or thrown, if that wasn't done."""
    section, lines = section_of(number)
    truth, cloud = folder / "truth.json", folder / ("scan/cloud.laz" if is_scanned else "thrown.laz")
    settings = [
        *_SETTINGS,
        *(_WORN if lines == "worn" else ()),
        f'road.cross_section="{section}"',
        f'road.design_class="{design_class_of(section, "EKL1")}"',
        f"seed={seed + number}",
    ]
    scenario = load_scenario("country-600m", settings)
    if not truth.exists():
        folder.mkdir(parents=True, exist_ok=True)
        road = sample_road(scenario.road, scenario.seed)
        if lines == "none":
            data = json.loads(road.to_json())
            data["objects"] = {name: item for name, item in data["objects"].items() if item["type"] != "LineMarking"}
            road = RoadParameters.from_dict(data, source="road without lines")
        truth.write_text(road.to_json(), encoding="utf-8")
    parameters = read_parameters(truth)
    if not cloud.exists() and is_scanned:
        from synthroads_addon import Job, generate

        generate(Job(scenario, folder / "scan", parameters=truth, overwrite=True, new_file=True))
    elif not cloud.exists():
        throw(parameters, seed - _FIRST_SEED + number, lines == "worn", cloud)
    return parameters, cloud


def throw(road: RoadParameters, seed: int, is_worn: bool, cloud: Path) -> None:
    """Throw points onto a road's analytic surface, and write them as a cloud; worn paint is pavement in patches."""
    block = cloud_of(road, _THROWN, seed)
    if is_worn:
        rng = np.random.default_rng([seed, 3])
        patch = np.floor((block.xyz[:, :2] - block.xyz[:, :2].min(axis=0)) / _PATCH).astype(np.int64)
        left = rng.uniform(*_LEFT, patch.max(axis=0) + 1)[patch[:, 0], patch[:, 1]]
        is_paint, is_road = (block.class_id == class_id(name) for name in ("road_marking", "road"))
        is_gone = is_paint & (rng.random(len(left)) > left)
        block.intensity[is_gone] = rng.choice(block.intensity[is_road], is_gone.sum())
        block.class_id[is_gone] = class_id("road")
    write(cloud, block)


def without_classes(cloud: RoadCloud) -> RoadCloud:
    """Return a cloud whose classes tell ground from what stands on it, and nothing else."""
    kind = np.where(cloud.of(*SURFACE), PointKind.GROUND, cloud.kind).astype(np.uint8)
    return replace(cloud, kind=kind, labelled=False, marked=False)


def measure(cloud: RoadCloud, truth: RoadParameters, section: str) -> Figures:
    """Return the figures of a road's reconstruction; one that is refused is doubted, with no lane right."""
    length = RoadGeometry(truth).length
    try:
        result = reconstruct(cloud)
    except SynthRoadsError as refusal:
        return Figures(str(refusal), length, np.nan, np.nan, 0.0, 0.0, 0.0, 0.0, False, False, False)
    error, is_doubted = axis_errors(result, truth)
    is_near = error < _RIGHT
    sides = compare(result.parameters, truth)["carriageways"].values()
    broken, broken_before = ({violation.rule for violation in check(road)} for road in (result.parameters, truth))
    return Figures(
        refused="",
        length=length,
        mean=float(np.nanmean(error)),
        largest=float(np.nanmax(error)),
        lanes=float(np.mean([side.get("lanes_right", 0.0) for side in sides])),
        near=float(is_near.sum()),
        silent=float(((error > _SILENT) & ~is_doubted).sum()),
        doubted=float((is_near & is_doubted).sum()),
        section=result.measured.section.nearest == section,
        design_class=result.parameters.design_class == truth.design_class,
        lines=lines_between(result.parameters) == lines_between(truth),
        rules=tuple(sorted(broken - broken_before)),
        reasons=tuple(sorted({reason for doubt in result.judgement.doubts for reason in doubt.reasons})),
    )


def axis_errors(result: Reconstruction, truth: RoadParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return the axis' error (N,), m, at each metre of the true road, and whether it is doubted there (N,).

    NaN, and doubted, where the reconstruction doesn't reach.
    """
    true_road, road = RoadGeometry(truth), RoadGeometry(result.parameters)
    point = true_road.alignment.position(np.arange(0.5, true_road.length))
    shift = np.array(truth.transform.translate[:2]) - np.array(result.parameters.transform.translate[:2])
    station, offset = road.alignment.project(point + shift)
    is_reached = (station > 0.0) & (station < road.length) & (np.abs(offset) < _LATERAL_REACH)
    is_doubted = ~is_reached
    for doubt in result.judgement.doubts:
        is_doubted |= (station >= doubt.start) & (station <= doubt.end)
    return np.where(is_reached, np.abs(offset), np.nan), is_doubted


def lines_between(road: RoadParameters) -> int:
    """Return the number of lines between the directions of a single carriageway: at its axis, or beside it."""
    number = 0
    for marking in road.of_type(LineMarking).values():
        carriageway = road.objects[marking.carriageway]
        assert isinstance(carriageway, Carriageway)
        number += marking.kind == "inner_edge" and marking.boundary == len(carriageway.lanes)
    return number or int(any(marking.kind == "free" for marking in road.of_type(LineMarking).values()))


HEAD = (
    "roads",
    "roads of the kind",
    "refused",
    "axis: mean, largest (m)",
    "lanes right (% of the length)",
    "within 0.3 m (%)",
    "over 1 m off, not doubted (%)",
    "doubted though within 0.3 m (%)",
    "cross-section right",
    "class right",
    "lines between the directions right",
    "with rules broken that the true road keeps",
)


def row(name: str, roads: list[Figures]) -> str:
    """Return the table's row of some roads."""
    there = [one for one in roads if not one.refused]
    length = sum(one.length for one in roads)

    def share(field: str) -> str:
        """Return the percentage of the length that a field holds."""
        return f"{100.0 * sum(getattr(one, field) for one in roads) / length:.1f}"

    def count(field: str) -> str:
        """Return on how many of the roads a field holds."""
        return str(sum(bool(getattr(one, field)) for one in there))

    axis = f"{np.mean([one.mean for one in there]):.3f}, {max(one.largest for one in there):.3f}" if there else "–"
    lanes = f"{100.0 * np.mean([one.lanes for one in roads]):.1f}"
    cells = (
        name,
        str(len(roads)),
        str(len(roads) - len(there)),
        axis,
        lanes,
        share("near"),
        share("silent"),
        share("doubted"),
        count("section"),
        count("design_class"),
        count("lines"),
        count("rules"),
    )
    return f"| {' | '.join(cells)} |"


def table(by_kind: dict[str, list[Figures]]) -> str:
    """Return the table of the documentation: a row for each cross-section, one for each state of the lines, and all."""
    rows = [f"| {' | '.join(HEAD)} |", "|---|" + "--:|" * (len(HEAD) - 1)]
    return "\n".join([*rows, *(row(name, roads) for name, roads in by_kind.items() if roads)])


def main() -> None:
    """Make and measure the roads; print the figures of each, and the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for roads, clouds and figures")
    parser.add_argument("--roads", type=int, default=60, metavar="N", help="number of roads (60)")
    parser.add_argument("--first", type=int, default=0, metavar="N", help="number of the first road (0)")
    parser.add_argument("--without-classes", action="store_true", help="pavement and paint are told by brightness")
    parser.add_argument("--seed", type=int, default=_FIRST_SEED, metavar="N", help=f"of the first road ({_FIRST_SEED})")
    parser.add_argument("--scanned", type=int, default=8, metavar="N", help="of them, the first N are scanned (8)")
    parser.add_argument("--only-scan", action="store_true", help="make the clouds, and measure nothing")
    parser.add_argument("--again", action="store_true", help="measure again what was measured before")
    parser.add_argument(
        "--part", nargs=2, type=int, default=(1, 1), metavar=("I", "N"), help="every Nth road from the Ith"
    )
    parser.add_argument("--document", type=Path, help="Markdown file whose table between its markers is rewritten")
    arguments = parser.parse_args()
    part, parts = arguments.part
    groups: dict[str, list[Figures]] = {
        name: [] for name in (*SECTIONS, "fresh lines", "worn lines", "no lines", "scanned", "all")
    }
    for number in range(arguments.first + part - 1, arguments.roads, parts):
        folder = arguments.folder / f"{number:03d}"
        truth, cloud = make(number, folder, number < arguments.scanned, arguments.seed)
        if arguments.only_scan:
            continue
        section, lines = section_of(number)
        path = folder / f"figures{'-without-classes' if arguments.without_classes else ''}.json"
        if arguments.again or not path.exists():
            points = read_road_cloud(cloud)
            figures = measure(without_classes(points) if arguments.without_classes else points, truth, section)
            path.write_text(json.dumps(asdict(figures)), encoding="utf-8")
        values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        figures = Figures(**{field.name: values[field.name] for field in fields(Figures)})
        for name in (section, f"{'no' if lines == 'none' or section == 'W5.5' else lines} lines", "all"):
            groups[name].append(figures)
        if number < arguments.scanned:
            groups["scanned"].append(figures)
        print(f"{number} {section} {lines}: {figures}", flush=True)
    if not arguments.only_scan:
        text = table(groups)
        print(text)
        if arguments.document:
            name = "country roads without classes" if arguments.without_classes else "country roads"
            put_tables(arguments.document, [name], lambda: {name: text})


if __name__ == "__main__":
    main()
