"""Find the centreline of a road in a cloud by several methods, its standard deviations, and where it is doubtful."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target, path_beside, write_file
from synthroads_addon.base.remarks import remarks_so_far
from synthroads_addon.base.schema import canonical_json

if TYPE_CHECKING:
    from synthroads_addon.reconstruction.axis import Options, Predictor
    from synthroads_addon.reconstruction.cloud import RoadCloud


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads centerline` to its parser."""
    parser.add_argument("cloud", type=Path, metavar="CLOUD", help="cloud to read (.laz, .las, .ply, .pcd, .e57, .npz)")
    text = "centreline (.geojson); a report (.json) is written beside it (beside the cloud: "
    text += "cloud.laz-centerline.geojson)"
    parser.add_argument("--output", type=Path, metavar="FILE", help=text)
    parser.set_defaults(writes=True)
    text = "kind of road, if known (auto: found in the cloud)"
    parser.add_argument("--road", choices=("auto", "dual", "single"), default="auto", help=text)
    text = "approximate course of the road: CSV or GeoJSON in the cloud's coordinates (found in the cloud)"
    parser.add_argument("--path", type=Path, metavar="FILE", help=text)
    text = "folder or name (`synthroads list models`) of a trained centreline model that estimates the axis as well; "
    text += "none: use no trained model (the shipped model whose training data are most like the cloud)"
    parser.add_argument("--run", metavar="DIR_OR_NAME", help=text)
    text = "true axis (CSV, GeoJSON) to compare the result with; it does not influence the result"
    parser.add_argument("--truth", type=Path, metavar="FILE", help=text)
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads centerline`; return exit code (3 if doubtful), report as JSON data and printed text."""
    cloud_file: Path = arguments.cloud
    lines: Path = arguments.output or path_beside(cloud_file, f"{cloud_file.name}-centerline.geojson", "CLOUD")
    option = "--output" if arguments.output else ""
    check_file_target(lines, option, arguments.overwrite, ending=".geojson")
    table = lines.with_suffix(".json")
    check_file_target(table, option, arguments.overwrite)
    from synthroads_addon.reconstruction.centreline import centreline_geojson, centreline_report, find_centreline
    from synthroads_addon.reconstruction.cloud import read_road_cloud
    from synthroads_addon.reconstruction.comparison import compare_line
    from synthroads_addon.road.axes.centerline import check_axis_file, read_axis

    if arguments.truth is not None:
        check_axis_file(arguments.truth)
    cloud = read_road_cloud(arguments.cloud)
    axis = read_axis(arguments.truth, cloud.place) if arguments.truth else None
    network, why = _network(arguments)
    centreline = find_centreline(cloud, _options(arguments, cloud, network), progress_bar(arguments))
    result = centreline_report(centreline, cloud) | {"network": why}
    if axis is not None:
        result["comparison"] = compare_line(centreline.path, axis[:, :2] - cloud.origin[:2])
    result["remarks"] = remarks_so_far()
    text = canonical_json(centreline_geojson(centreline, cloud, arguments.cloud.stem))
    write_file(lines, text.encode(), overwrite=arguments.overwrite)
    write_file(table, canonical_json(result).encode(), overwrite=arguments.overwrite)
    return 3 if centreline.judgement.doubts else 0, result, summary(result, lines)


def _network(arguments: argparse.Namespace) -> tuple[Predictor | None, dict[str, Any]]:
    """Return the network's view that is asked for, or that of the shipped model for the cloud, and why it is that."""
    model = arguments.run
    if model == "none":
        return None, {"model": None, "why": "no network, as asked"}
    try:
        from ml.centerline.learned_axis import learned_axis
        from ml.choice import choose_model
    except ModuleNotFoundError as error:
        if model is not None or error.name != "torch":
            raise
        return None, {"model": None, "why": "no network: PyTorch isn't installed"}
    if model is not None:
        return learned_axis(Path(model), arguments.cloud), {"model": model, "why": f"{model}, as asked"}
    try:
        choice = choose_model(arguments.cloud, "centerline")
    except InputError as error:
        return None, {"model": None, "why": f"no network: {error}"}
    if choice.doubtful:
        return None, choice.to_dict() | {"model": None, "why": f"no network: {choice.why()}"}
    return learned_axis(Path(choice.card.name), arguments.cloud), choice.to_dict()


def _options(arguments: argparse.Namespace, cloud: RoadCloud, network: Predictor | None) -> Options:
    """Return the options of the search for the centreline that the arguments ask for."""
    from synthroads_addon.reconstruction.axis import Options
    from synthroads_addon.road.axes.centerline import read_axis

    course = read_axis(arguments.path, cloud.place)[:, :2] - cloud.origin[:2] if arguments.path else None
    return Options(road=None if arguments.road == "auto" else arguments.road, path=course, predictor=network)


def summary(result: dict[str, Any], output: Path) -> str:
    """Return a centreline's report as text: length, views, doubts, comparison with the truth."""

    from synthroads_addon.reconstruction.report import reservation_lines

    std = result["std"]
    lines = [f"{result['road']} carriageway, centreline of {result['length']:.0f} m (std {std['mean']:.2f} m)"]
    for view in result["views"]:
        distance = view["from_centreline"].get("rms")
        distance_text = "" if distance is None else f", {distance:.2f} m rms from it"
        lines.append(f"  {view['name']}: seen on {view['seen']:.0%}, agrees on {view['used']:.0%}{distance_text}")
    lines.append(f"  network: {result['network']['why']}")
    lines += [f"  {line}" for line in reservation_lines(result)]
    return "\n".join([*lines, f"written to {output}"])


if __name__ == "__main__":
    entry("centerline")
