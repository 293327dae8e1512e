"""Print the tables of docs/reconstruction.md: roads of eight kinds, generated, scanned, reconstructed and compared.

python studies/reconstruction/roads.py out/reconstruction              # 40 roads
python studies/reconstruction/roads.py out/reconstruction --roads 1    # one of each kind
python studies/reconstruction/roads.py out/reconstruction --again      # reconstruct the scans that are there once more

Each road has a folder with its parameters, its cloud and what was measured; what is there already isn't made again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.errors import SynthRoadsError  # noqa: E402
from synthroads_addon.reconstruction.cloud import SURFACE, PointKind, RoadCloud, read_road_cloud  # noqa: E402
from synthroads_addon.reconstruction.comparison import compare  # noqa: E402
from synthroads_addon.reconstruction.reconstruct import Reconstruction, reconstruct  # noqa: E402
from synthroads_addon.reconstruction.width_comparison import WidthErrors, compare_widths  # noqa: E402
from synthroads_addon.road.parameters import RoadParameters, read_parameters  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scenario.road import RoadScenario  # noqa: E402

THROWN = 15.0
"""Points per m2 of roads that aren't scanned."""
LIMITS: dict[str, Any] = {
    "half_width": 36.0,
    "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0},
    "lane_changes": {"share": 0.0},
    "furniture": {"construction_zone": 0.0, "overpass": 0.0, "gantries": 0.1},
    "environment": {"wet": 0.0, "bad_weather": 0.0},
}
"""Limits of all roads, unless a kind says otherwise: no survey is flown in fog or over a wet road."""
WIDE = {"lanes": [3.5, 3.5], "hard_shoulder": 0.0, "outer_edge_strip": 0.5, "inner_edge_strip": 0.5, "median": 2.5}
SLIM = {"lanes": [3.25, 3.25], "hard_shoulder": 0.0, "outer_edge_strip": 0.3, "inner_edge_strip": 0.3, "median": 2.5}
RURAL = [
    {"lanes": [3.5], "hard_shoulder": 0.0, "outer_edge_strip": strip, "inner_edge_strip": 0.15, "median": 2.5}
    for strip in (0.5, 0.3, 0.75, 0.3, 0.5)
]
RURAL_LANES = (3.25, 2.75, 3.5, 3.0, 3.25)
"""Widths of single carriageways' lanes, m: narrower than any motorway's."""
TIGHT, CURVED, FLAT = (
    {"minimum": 280.0, "maximum": 500.0},
    {"minimum": 900.0, "maximum": 1500.0},
    {"minimum": 3000.0, "maximum": 5000.0},
)


@dataclass(frozen=True)
class Kind:
    """A kind of road: the limits of its roads, one after the other, and how the lines of a single carriageway are.

    Attributes:
        name: of the kind.
        roads: limits of each road beside `LIMITS`.
        middle: dash and gap, m, of a single carriageway's middle line; None without one.
        single: whether it is a single carriageway.
    """

    name: str
    roads: tuple[dict[str, Any], ...]
    single: bool = False
    middle: tuple[float, float] | None = None


def _roads(sections: list[Any], lengths: float, **limits: Any) -> tuple[dict[str, Any], ...]:
    """Return limits of roads with these cross-sections, of a design class that has them, curved and flat by turns."""
    result = []
    for number, section in enumerate(sections):
        is_motorway = section in ("RQ31", "RQ36", "RQ43.5")
        motorway_limits, slow_limits = (("EKA1A", CURVED), ("EKA3", TIGHT))
        design_class, radius = motorway_limits if is_motorway else slow_limits
        if section == "RQ28":
            design_class, radius = "EKA1B", CURVED
        data = {"cross_section": section, "design_class": design_class, "length": lengths}
        result.append(data | {"radius": FLAT if number % 2 else radius} | limits)
    return tuple(result)


_NO_BARRIERS = {"median": False, "roadside": False, "noise_barrier": 0.0}
_QUIET_SIDES = {"barriers": {"roadside": False, "noise_barrier": 0.0}}
KINDS = (
    Kind("dual, hard shoulder", _roads(["RQ31", "RQ28", "RQ36", "RQ31.5", "RQ43.5"], 400.0)),
    Kind(
        "emergency bays",
        _roads(
            ["RQ31", "RQ36", "RQ31", "RQ28", "RQ43.5"], 450.0, turnouts=LIMITS["turnouts"] | {"emergency_bays": 1.0}
        ),
    ),
    Kind(
        "exits and entries",
        tuple(
            limits | {"turnouts": LIMITS["turnouts"] | {"exits": float(number % 2 == 0), "entries": float(number % 2)}}
            for number, limits in enumerate(_roads(["RQ31", "RQ36", "RQ28", "RQ31", "RQ43.5"], 600.0))
        ),
    ),
    Kind(
        "lanes begin or end", _roads(["RQ36", "RQ43.5", "RQ36", "RQ36", "RQ43.5"], 500.0, lane_changes={"share": 1.0})
    ),
    Kind("winding", _roads(["RQ25", "RQ31.5", "RQ25", "RQ31.5", "RQ25"], 500.0, radius=TIGHT)),
    Kind(
        "narrow, without shoulder",
        _roads([WIDE, SLIM, WIDE, SLIM, WIDE], 400.0, markings={"lane_dash": 4.0, "lane_gap": 8.0}, **_QUIET_SIDES),
    ),
    Kind("rural", _roads(RURAL, 400.0, barriers=_NO_BARRIERS), True, (4.0, 8.0)),
    Kind("rural, no centre line", _roads(RURAL, 400.0, barriers=_NO_BARRIERS), True),
)

SURVEY = {
    "fidelity": "draft",
    "outputs": ["cloud"],
    "cloud.attributes": [],
    "colour.intensity_from_layers": True,
    "scan.platform.height": 530,
    "scan.field_of_view_deg": 9,
    "scan.pulse_rate_khz": 1000,
    "scan.lines_per_second": 300,
}
"""Settings of a survey by aircraft as in the recipe centerline-airborne-even."""
UNEVEN = SURVEY | {
    "scan.platform": {"kind": "airborne", "speed": 57, "lateral_offsets": [-25, 25], "height": 740},
    "scan.field_of_view_deg": 8,
    "scan.pulse_rate_khz": 700,
    "scan.lines_per_second": 195,
    "scan.mirror_clock": "free",
    "scan.motion": {
        "shortest_period": 0.05,
        "longest_period": 20,
        "period_exponent": 0.5,
        "position_sigma": 0.4,
        "attitude_sigma_deg": 0.3,
        "heading_sigma_deg": 2,
    },
    "scan.noise.range_sigma": 0.023,
    "scan.noise.speckle": 0.1,
    "scan.noise.angle_sigma_mrad": 0.02,
    "scan.receiver": {
        "echo_separation": "waveform",
        "threshold_to_noise": 5,
        "faint_range_sigma": 0.06,
        "range_walk": 0.003,
        "range_delay": 0.45,
    },
    "scan.strip_errors": {
        "boresight_sigma_deg": 0.001,
        "drift_sigma": 0.01,
        "gain_sigma_db": 0.2,
        "gain_step_db": 1.0,
    },
}
"""Settings of one with uneven strips, noise and speckle, as in the recipe centerline-airborne; every second road's."""


def sample(kind: Kind, number: int) -> RoadParameters:
    """Return a kind's road of a number: sampled, a single carriageway made of one whose median is taken out."""
    road = sample_road(RoadScenario.from_dict(LIMITS | kind.roads[number]), 1000 + 10 * KINDS.index(kind) + number)
    return _single(road, RURAL_LANES[number], kind.middle) if kind.single else road


def _single(road: RoadParameters, lane: float, middle: tuple[float, float] | None) -> RoadParameters:
    """Return a road whose two carriageways of one lane (m) meet in the axis, perhaps in a dashed line (m)."""
    data = json.loads(road.to_json())
    objects: dict[str, dict[str, Any]] = {}
    for name, item in data["objects"].items():
        item_offset = item.get("offset", 100.0)
        if item["type"] in ("Median", "Gutter", "Vehicle") or (
            isinstance(item_offset, float)
            and abs(item_offset) < 1.5
            and "offset" in item
            and item["type"] != "LineMarking"
        ):
            continue
        if item["type"] == "Carriageway":
            item |= {"inner_offset": 0.0, "inner_edge_strip_width": 0.0, "rotation_axis": "inner_edge"}
            item["lanes"] = [{"width": lane}]
            item["pavement"] |= {"removed_markings": [], "patches": [], "cracks": [], "potholes": []}
        if item["type"] == "LineMarking":
            if item["kind"] == "inner_edge":
                if middle is None or item["carriageway"] != "carriageway-right":
                    continue
                dash, gap = middle
                item |= {"kind": "free", "boundary": 0, "width": 0.12, "dash_length": dash, "gap_length": gap}
            item["width"] = 0.12
        objects[name] = item
    return RoadParameters.from_dict(data | {"objects": objects}, source="single carriageway")


def scan(parameters: Path, settings: dict[str, Any], folder: Path) -> Path:
    """Scan a road into a folder, if that wasn't done; return the cloud."""
    cloud = folder / "cloud.laz"
    if not cloud.exists():
        words = [word for path, value in settings.items() for word in ("--set", f"{path}={json.dumps(value)}")]
        words += [
            "--scenario",
            "airborne-1000m-even",
            "--parameters",
            str(parameters),
            "--output",
            str(folder),
            "--overwrite",
        ]
        subprocess.run([sys.executable, "-m", "headless.generate", *words, "--quiet"], check=True, cwd=ROOT)
    return cloud


def throw(parameters: RoadParameters, seed: int, folder: Path) -> Path:
    """Throw points onto a road's analytic surface at random, if that wasn't done; return the cloud."""
    from tests.helpers.clouds.road_clouds import cloud_of, write

    cloud = folder / "thrown.laz"
    return cloud if cloud.exists() else write(cloud, cloud_of(parameters, THROWN, seed))


def without_classes(cloud: RoadCloud) -> RoadCloud:
    """Return a cloud whose classes tell ground from what stands on it, and nothing else."""
    kind = np.where(cloud.of(*SURFACE), PointKind.GROUND, cloud.kind).astype(np.uint8)
    return replace(cloud, kind=kind, labelled=False, marked=False)


def measure(cloud: RoadCloud, truth: RoadParameters) -> dict[str, Any]:
    """Return how a road's reconstruction differs from the truth, as JSON data."""
    reconstruction = reconstruct(cloud)
    widths = compare_widths(reconstruction, truth)
    differences = compare(reconstruction.parameters, truth)
    return {
        "covered": differences["covered"],
        "axis": differences["centreline"],
        "elements": len(reconstruction.parameters.alignment.horizontal),
        "true_elements": len(truth.alignment.horizontal),
        "trusted": reconstruction.judgement.trusted,
        "doubts": [stretch.reasons for stretch in reconstruction.judgement.doubts],
        "sections": [stretch.reasons for stretch in reconstruction.judgement.sections],
        "marked": _marked(reconstruction, widths),
        "widths": [_width(stretch) for stretch in widths],
    }


def _marked(reconstruction: Reconstruction, widths: list[WidthErrors]) -> float:
    """Return the share of all sections, by side, that are marked or doubted."""
    by_side = {width_errors.side: width_errors.marked for width_errors in widths}
    return float(np.mean([by_side[side] for side in reconstruction.measured.section.sides]))


def _width(width_errors: WidthErrors) -> dict[str, Any]:
    """Return as JSON data one width's errors in the sections that aren't marked: number, how many are off, medians.

    What is said to be a guess is counted by itself, unless the number of lanes is another than the true one.
    """
    is_known = ~np.isnan(width_errors.off) & ~width_errors.marked
    is_guess = np.isinf(width_errors.std) & np.isfinite(width_errors.error)
    is_measured = is_known & ~is_guess
    finite_errors = np.where(np.isfinite(width_errors.error) & is_measured, width_errors.error, np.nan)
    return {
        "side": width_errors.side,
        "name": width_errors.name,
        "sections": int(is_measured.sum()),
        "off": int((width_errors.off[is_measured] > 3.0).sum()),
        "in_68": int((width_errors.off[is_measured] <= 1.0).sum()),
        "in_95": int((width_errors.off[is_measured] <= 1.96).sum()),
        "guesses": int((is_known & is_guess).sum()),
        "error": float(np.nanmedian(finite_errors)) if np.isfinite(finite_errors).any() else None,
        "std": float(np.median(width_errors.std[is_measured]))
        if is_measured.any() and np.isfinite(width_errors.std[is_measured]).all()
        else None,
    }


def measured_roads(arguments: argparse.Namespace) -> Iterator[tuple[Kind, str, dict[str, Any]]]:
    """Yield (kind, name, measurements) of each road, made and measured unless that was done before."""
    suffix = "-".join(word for word in ("thrown", "without_classes") if getattr(arguments, word))
    for number in range(min(arguments.roads, max(len(kind.roads) for kind in KINDS))):
        for index, kind in enumerate(KINDS):
            name = f"{index}-{number}"
            road_folder = arguments.folder / name
            road_folder.mkdir(parents=True, exist_ok=True)
            report = road_folder / f"measured{suffix}.json"
            if arguments.again or not report.exists():
                result = _measured_road(kind, number, road_folder, arguments)
                report.write_text(json.dumps(result, indent=1), encoding="utf-8")
                print(f"{name} {kind.name}: {summary(result)}", file=sys.stderr, flush=True)
            yield kind, name, json.loads(report.read_text(encoding="utf-8"))


def _measured_road(kind: Kind, number: int, road_folder: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the measurements of a road, made unless its cloud is there; why, where it is refused."""
    parameters = road_folder / "truth.json"
    if not parameters.exists():
        parameters.write_text(sample(kind, number).to_json(), encoding="utf-8")
    truth = read_parameters(parameters)
    settings = UNEVEN if number % 2 else SURVEY
    cloud = read_road_cloud(
        throw(truth, number, road_folder) if arguments.thrown else scan(parameters, settings, road_folder)
    )
    try:
        return measure(without_classes(cloud) if arguments.without_classes else cloud, truth)
    except SynthRoadsError as error:
        return {"refused": str(error)}


def summary(result: dict[str, Any]) -> str:
    """Return one road's measurements in a line."""
    if "refused" in result:
        return f"refused: {result['refused']}"
    wrong_widths = [
        f"{width['side']} {width['name']} {width['error']} +- {width['std']} in {width['off']} of {width['sections']}"
        for width in result["widths"]
        if width["off"]
    ]
    axis = result["axis"].get("mae"), result["axis"].get("largest")
    return (
        f"{result['elements']} elements of {result['true_elements']}, axis {axis[0]} m, at most {axis[1]} m, "
        f"trusted {result['trusted']:.2f}, marked {result['marked']:.2f}; off: {'; '.join(wrong_widths) or 'none'}"
    )


HEAD = (
    "kind",
    "roads",
    "widths off by more than 3 deviations (%)",
    "in 68 % (%)",
    "in 95 % (%)",
    "guesses (%)",
    "sections marked (%)",
    "elements within one",
    "axis: mean, largest (m)",
    "doubted (% of the length)",
)


def row(name: str, results: list[dict[str, Any]]) -> tuple[str, ...]:
    """Return the table's row of some roads' measurements."""
    reconstructed = [result for result in results if "refused" not in result]
    widths = [width for result in reconstructed for width in result["widths"]]
    total = max(sum(width["sections"] for width in widths), 1)
    count_near = sum(abs(result["elements"] - result["true_elements"]) <= 1 for result in reconstructed)
    axes = [result["axis"] for result in reconstructed if result["axis"]]

    def share(name: str) -> str:
        """Return the percentage of widths of a kind."""
        return f"{100.0 * sum(width[name] for width in widths) / total:.1f}"

    def guessed() -> str:
        """Return the percentage of widths that are guesses."""
        number = sum(width["guesses"] for width in widths)
        return f"{100.0 * number / max(total + number, 1):.1f}"

    def mean(name: str) -> str:
        """Return the mean percentage of a figure over the roads."""
        return f"{100.0 * float(np.mean([result[name] for result in reconstructed])):.1f}" if reconstructed else "–"

    axis = (
        f"{np.mean([result['mae'] for result in axes]):.3f}, {max(result['largest'] for result in axes):.3f}"
        if axes
        else "–"
    )
    doubted = (
        f"{100.0 * float(np.mean([1.0 - result['trusted'] for result in reconstructed])):.1f}" if reconstructed else "–"
    )
    cells = (
        share("off"),
        share("in_68"),
        share("in_95"),
        guessed(),
        mean("marked"),
        f"{count_near} of {len(results)}",
        axis,
        doubted,
    )
    return (name, str(len(results)), *cells)


def main() -> None:
    """Make and measure the roads; print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for roads, clouds and measurements")
    parser.add_argument("--roads", type=int, default=5, metavar="N", help="roads of each kind, at most 5 (5)")
    parser.add_argument("--again", action="store_true", help="reconstruct what was reconstructed before once more")
    parser.add_argument("--without-classes", action="store_true", help="pavement and paint are told by brightness")
    parser.add_argument("--thrown", action="store_true", help="points thrown onto the roads at random, not scanned")
    arguments = parser.parse_args()
    by_kind: dict[str, list[dict[str, Any]]] = {}
    for kind, _, result in measured_roads(arguments):
        by_kind.setdefault(kind.name, []).append(result)
    rows = [HEAD, ("---",) * len(HEAD)]
    rows += [row(name, results) for name, results in by_kind.items()]
    rows.append(row("all", [one for results in by_kind.values() for one in results]))
    print("\n".join(f"| {' | '.join(cells)} |" for cells in rows))


if __name__ == "__main__":
    main()
