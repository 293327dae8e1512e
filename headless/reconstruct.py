"""Turn a cloud into the parameters of its road, with deviations from the cloud, and a geometric-semantic model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.options import add_renamed_argument, add_twin_argument
from headless.pictures import can_draw
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.machine import linear_algebra_on_one_thread
from synthroads_addon.base.progress import in_stage
from synthroads_addon.base.remarks import remarks_so_far
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.twin.formats import check_formats, twin_file_names, write_twin

if TYPE_CHECKING:
    from synthroads_addon.base.maps.places import Placement
    from synthroads_addon.reconstruction.report import ReconstructedRoad, ReconstructionJob
    from synthroads_addon.road.parameters import RoadParameters

PARAMETERS, REPORT, CENTRELINE, PICTURE = (
    "parameters.json",
    "reconstruction.json",
    "centerline.geojson",
    "reconstruction.png",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads reconstruct` to its parser."""
    parser.add_argument("cloud", type=Path, metavar="CLOUD", help="cloud to read (.laz, .las, .ply, .pcd, .e57, .npz)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the files")
    text = "kind of road, if known (auto: found in the cloud)"
    parser.add_argument("--road", choices=("auto", "dual", "single"), default="auto", help=text)
    text = "approximate course of the road: CSV or GeoJSON in the cloud's coordinates (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "folder of a trained centreline model that estimates the axis as well (no trained model)"
    parser.add_argument("--run", type=Path, metavar="DIR", help=text)
    text = "largest root mean square distance of the alignment from the measured axis, m (0.03)"
    parser.add_argument("--fit-tolerance", type=float, default=0.03, metavar="M", help=text)
    add_renamed_argument(parser, "--tolerance", "--fit-tolerance")
    text = "use the widths of the standard cross-section that matches all measured widths (the measured widths)"
    parser.add_argument("--snap", action="store_true", help=text)
    text = "true parameters (.json) or axis (CSV, GeoJSON) to compare the result with; no influence on the result"
    parser.add_argument("--truth", type=Path, metavar="FILE", help=text)
    parser.add_argument("--no-picture", action="store_true", help=f"don't draw {PICTURE}")
    add_twin_argument(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


@linear_algebra_on_one_thread(scipy=True)
def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads reconstruct`; return exit code (3 if doubtful), report as JSON data and printed text."""
    from synthroads_addon.reconstruction.report import TOLERANCES, run_reconstruction

    tolerance = arguments.fit_tolerance
    if not TOLERANCES[0] <= tolerance <= TOLERANCES[1]:
        raise InputError("--fit-tolerance", tolerance, f"must be from {TOLERANCES[0]:g} to {TOLERANCES[1]:g} m")
    check_formats(arguments.twin)
    arguments.no_picture = arguments.no_picture or not can_draw(PICTURE)
    if arguments.truth is not None:
        _check_truth(arguments.truth)
    names = [PARAMETERS, REPORT, CENTRELINE, *([] if arguments.no_picture else [PICTURE])]
    with output_folder(arguments.output, [*names, *twin_file_names(arguments.twin)], arguments.overwrite) as folder:
        progress = progress_bar(arguments)
        road = run_reconstruction(_job(arguments), progress)
        compare_with_truth = _comparison(arguments.truth, road.cloud.place)
        _write(road, folder, arguments.no_picture)
        result, parameters = road.report, road.reconstruction.parameters
        if compare_with_truth is not None:
            result["comparison"] = compare_with_truth(parameters)
        result["remarks"] = remarks_so_far()
        (folder / REPORT).write_text(canonical_json(result), encoding="utf-8")
        write_twin(parameters, folder, arguments.twin, progress=in_stage(progress, "twin"))
    return 3 if road.reconstruction.judgement.is_doubtful else 0, result, summary(result, arguments.output)


def _check_truth(truth: Path) -> None:
    """Raise an InputError for a file that is no truth, before any work."""
    from synthroads_addon.road.axes.centerline import check_axis_file
    from synthroads_addon.road.parameters import read_parameters

    if truth.suffix.lower() == ".json":
        read_parameters(truth)
    else:
        check_axis_file(truth)


def _comparison(truth: Path | None, place: Placement) -> Callable[[RoadParameters], dict[str, Any]] | None:
    """Read a file's true parameters or axis, and return a function that compares a road with it; None without one."""
    if truth is None:
        return None
    from synthroads_addon.reconstruction.comparison import compare, compare_axis

    if truth.suffix.lower() == ".json":
        from synthroads_addon.road.parameters import read_parameters

        parameters = read_parameters(truth)
        return lambda road: compare(road, parameters)
    from synthroads_addon.road.axes.centerline import read_axis

    axis = read_axis(truth, place)
    return lambda road: compare_axis(road, axis)


def _job(arguments: argparse.Namespace) -> ReconstructionJob:
    """Return the reconstruction that the arguments ask for."""
    from synthroads_addon.reconstruction.report import ReconstructionJob

    predictor = None
    if arguments.run:
        from ml.centerline.learned_axis import learned_axis

        predictor = learned_axis(arguments.run, arguments.cloud)
    return ReconstructionJob(
        cloud=arguments.cloud,
        road=None if arguments.road == "auto" else arguments.road,
        course=arguments.path,
        tolerance=arguments.fit_tolerance,
        snap=arguments.snap,
        predictor=predictor,
    )


def _write(road: ReconstructedRoad, folder: Path, no_picture: bool) -> None:
    """Write parameters, centreline and picture into a folder."""
    from synthroads_addon.road.axes.centerline import centerline_geojson
    from synthroads_addon.road.geometry import RoadGeometry
    from synthroads_addon.road.tessellation import sample_stations

    result = road.reconstruction
    geometry = RoadGeometry(result.parameters)
    (folder / PARAMETERS).write_text(result.parameters.to_json(), encoding="utf-8")
    line = centerline_geojson(geometry, sample_stations(geometry, 0.005))
    line["features"][0]["properties"]["doubtful"] = result.judgement.to_dict()["doubtful"]
    (folder / CENTRELINE).write_text(canonical_json(line), encoding="utf-8")
    if not no_picture:
        from synthroads_addon.reconstruction.picture import draw

        draw(result, road.cloud, folder / PICTURE)


def summary(result: dict[str, Any], output: Path) -> str:
    """Return a reconstruction's report as text: alignment, widths, objects, doubts, comparison with the truth."""
    from synthroads_addon.reconstruction.report import measure_lines, reservation_lines

    first, *lines = (*measure_lines(result), *reservation_lines(result))
    return "\n".join([first, *(f"  {line}" for line in lines), f"written to {output}"])


if __name__ == "__main__":
    entry("reconstruct")
