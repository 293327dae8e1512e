"""Turn a cloud into a road's parameters, with the deviations of the cloud from it, and its geometric-semantic model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, add_renamed_argument, add_twin_argument, entry
from headless.messages import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.twin.formats import check_formats, twin_file_names, write_twin

if TYPE_CHECKING:
    from synthroads_addon.reconstruction.axis import Options
    from synthroads_addon.reconstruction.cloud import RoadCloud
    from synthroads_addon.reconstruction.reconstruct import Reconstruction
    from synthroads_addon.road.parameters import RoadParameters

PARAMETERS, REPORT, CENTRELINE, PICTURE = (
    "parameters.json",
    "reconstruction.json",
    "centerline.geojson",
    "reconstruction.png",
)
_TOLERANCES = (0.005, 1.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads reconstruct` to its parser."""
    parser.add_argument("cloud", type=Path, metavar="CLOUD", help="cloud to read (.laz, .las, .ply, .e57, .npz)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the files")
    text = "kind of road, where it is known (auto: found out)"
    parser.add_argument("--road", choices=("auto", "dual", "single"), default="auto", help=text)
    text = "course of the road, roughly: CSV or GeoJSON in the cloud's coordinates (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "folder of a trained centreline model: one more view of the axis (those that learn nothing)"
    parser.add_argument("--run", type=Path, metavar="DIR", help=text)
    text = "root mean square that the alignment may keep from the measured axis, m (0.03)"
    parser.add_argument("--fit-tolerance", type=float, default=0.03, metavar="M", help=text)
    add_renamed_argument(parser, "--tolerance", "--fit-tolerance")
    text = "take the widths of the standard cross-section that all measured ones are near to (the measured ones)"
    parser.add_argument("--snap", action="store_true", help=text)
    text = "true parameters (.json) or axis (CSV, GeoJSON) to compare with afterwards; they change nothing"
    parser.add_argument("--truth", type=Path, metavar="FILE", help=text)
    parser.add_argument("--no-picture", action="store_true", help=f"don't draw {PICTURE}")
    add_twin_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads reconstruct`; return exit code (3 if doubtful), report as JSON data and printed text."""
    tolerance = arguments.fit_tolerance
    if not _TOLERANCES[0] <= tolerance <= _TOLERANCES[1]:
        raise InputError("--fit-tolerance", tolerance, f"must be from {_TOLERANCES[0]:g} to {_TOLERANCES[1]:g} m")
    check_formats(arguments.twin)
    from synthroads_addon.reconstruction.cloud import read_road_cloud
    from synthroads_addon.reconstruction.reconstruct import reconstruct

    compared = _comparison(arguments.truth)
    names = [PARAMETERS, REPORT, CENTRELINE, *([] if arguments.no_picture else [PICTURE])]
    with output_folder(arguments.output, [*names, *twin_file_names(arguments.twin)], arguments.overwrite) as folder:
        cloud = read_road_cloud(arguments.cloud)
        road = reconstruct(cloud, _options(arguments, cloud, folder), progress_bar(arguments))
        result = _write(road, cloud, folder, arguments.no_picture)
        if compared is not None:
            result["comparison"] = compared(road.parameters)
        (folder / REPORT).write_text(canonical_json(result), encoding="utf-8")
        write_twin(road.parameters, folder, arguments.twin)
    return 3 if road.judgement.doubts or road.judgement.sections else 0, result, summary(result, arguments.output)


def _comparison(truth: Path | None) -> Callable[[RoadParameters], dict[str, Any]] | None:
    """Read a file's true parameters or axis, and return a function that compares a road with it; None without one."""
    if truth is None:
        return None
    from synthroads_addon.reconstruction.comparison import compare, compare_axis

    if truth.suffix.lower() == ".json":
        from synthroads_addon.road.parameters import read_parameters

        parameters = read_parameters(truth)
        return lambda found: compare(found, parameters)
    from synthroads_addon.road.centerline import read_axis

    axis = read_axis(truth)
    return lambda found: compare_axis(found, axis)


def _options(arguments: argparse.Namespace, cloud: RoadCloud, folder: Path) -> Options:
    from synthroads_addon.reconstruction.axis import Options
    from synthroads_addon.road.centerline import read_axis

    course = read_axis(arguments.path)[:, :2] - cloud.origin[:2] if arguments.path else None
    predictor = None
    if arguments.run:
        from ml.centerline.learned_axis import learned_axis

        predictor = learned_axis(arguments.run, arguments.cloud, folder)
    return Options(
        road=None if arguments.road == "auto" else arguments.road,
        tolerance=arguments.fit_tolerance,
        path=course,
        predictor=predictor,
        snap=arguments.snap,
        title=f"Reconstructed from {arguments.cloud.name}",
    )


def _write(found: Reconstruction, cloud: RoadCloud, folder: Path, no_picture: bool) -> dict[str, Any]:
    """Write parameters, centreline and picture into a folder; return the report as JSON data."""
    from synthroads_addon.reconstruction.report import report
    from synthroads_addon.road.centerline import centerline_geojson
    from synthroads_addon.road.geometry import RoadGeometry
    from synthroads_addon.road.tessellation import sample_stations

    geometry = RoadGeometry(found.parameters)
    (folder / PARAMETERS).write_text(found.parameters.to_json(), encoding="utf-8")
    line = centerline_geojson(geometry, sample_stations(geometry, 0.005))
    line["features"][0]["properties"]["doubtful"] = found.judgement.to_dict()["doubtful"]
    (folder / CENTRELINE).write_text(canonical_json(line), encoding="utf-8")
    result = report(found, cloud)
    if not no_picture:
        from synthroads_addon.reconstruction.picture import draw

        draw(found, cloud, folder / PICTURE)
    return result


def summary(result: dict[str, Any], output: Path) -> str:
    """Return a reconstruction's report as text: alignment, widths, objects, doubts, comparison with the truth."""
    section, line = result["section"], result["centreline"]
    off, std = 100.0 * line["from_alignment"]["rms"], 100.0 * line["std"]["mean"]
    lines = [f"{result['road']} carriageway of {result['length']:.0f} m, alignment of {line['elements']} elements"]
    lines += [f"  {off:.1f} cm rms from the measured axis (std {std:.1f} cm)"]
    for name, side in section["sides"].items():
        widths = " + ".join(f"{lane['value']:.2f}" for lane in side["lanes"])
        paved = side["paved_width"]
        spread = "not seen to its edge" if paved["std"] is None else f"std {paved['std']:.2f} m"
        lines.append(f"  {name}: lanes {widths} m, pavement {paved['value']:.2f} m ({spread})")
    standard = section["standard"]
    if standard and standard["within_tolerance"]:
        lines.append(
            f"  within {standard['largest_difference']:.2f} m of the standard cross-section {standard['name']}"
        )
    objects = result["objects"]
    bays = f", {len(result['emergency_bays'])} emergency bays" if result["emergency_bays"] else ""
    lines.append(f"  {len(objects['barriers'])} barriers, {len(objects['delineators'])} delineators{bays}")
    lines += reservations(result)
    return "\n".join([*lines, f"written to {output}"])


def reservations(result: dict[str, Any]) -> list[str]:
    """Return the lines of a report that tell its notes, doubtful stretches, and the comparison with the truth."""
    lines = [f"  note: {note}" for note in result["notes"]]
    for kind, what in (("doubtful", "doubtful"), ("other_sections", "another section")):
        for doubt in result["judgement"].get(kind, ()):
            place = f"{what} from {doubt['start']:.0f} to {doubt['end']:.0f} m"
            lines.append(f"  {place}: {'; '.join(doubt['why'])}")
    if "comparison" in result:
        off = result["comparison"]["centreline"]
        apart = f"{off['mae']:.3f} m on average, {off['largest']:.3f} m at most" if off else "nothing in common"
        lines.append(f"  from the truth: centreline {apart}")
    return lines


if __name__ == "__main__":
    entry("reconstruct")
