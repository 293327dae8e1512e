"""Work with point cloud files (LAZ, LAS, PLY, E57, NPZ): describe, thin out, convert, merge, crop, tile, draw, ..."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.cloud_table import table
from headless.commands import Outcome, entry
from headless.options import add_formats_argument, whole_number
from headless.progress import progress_bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads cloud` and its tools to the parser."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    _info_arguments(tools.add_parser("info", help="print figures of all points and of each class"))
    subsampling = tools.add_parser("subsample", help="keep one point per cell of a grid")
    _file_arguments(subsampling)
    subsampling.add_argument("--grid", type=float, default=0.04, metavar="M", help="edge of a cell, m (0.04)")
    mapping = tools.add_parser("map-intensity", help="map intensities to the distribution of another cloud")
    _file_arguments(mapping)
    mapping.add_argument("--target", required=True, type=Path, metavar="FILE", help="cloud with the distribution")
    mapping.add_argument("--per-class", action="store_true", help="map each class to the target's of the same name")
    conversion = tools.add_parser("convert", help="write another format, or merge classes")
    _file_arguments(conversion)
    add_formats_argument(conversion, "cloud")
    _preview_arguments(tools.add_parser("preview", help="draw the cloud from above and in cross-section"))
    merging = tools.add_parser("merge", help="put several clouds into one")
    merging.add_argument("files", type=Path, nargs="+", metavar="FILE", help="clouds, in the order of their points")
    merging.add_argument("--output", required=True, type=Path, metavar="FILE", help="file to write")
    cropping = tools.add_parser("crop", help="keep the points within a box, heights or a polygon")
    _file_arguments(cropping)
    _crop_arguments(cropping)
    tiles = tools.add_parser("tile", help="cut into square tiles, thinned out on request")
    _tile_arguments(tiles)
    for tool in (subsampling, conversion):
        tool.add_argument("--classes", metavar="NAME_OR_FILE", help="5, or a .json file of classes (as in the cloud)")
    for tool in (subsampling, mapping, conversion, merging, cropping, tiles):
        tool.add_argument("--overwrite", action="store_true", help="replace a file that is already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run a tool of `synthroads cloud`; return exit code, result as JSON data and printed text."""
    actions = {"info": _info, "subsample": _subsample, "map-intensity": _map_intensity, "convert": _convert}
    actions |= {"merge": _merge, "crop": _crop, "tile": _tile}
    return actions.get(arguments.tool, _preview)(arguments)


def _file_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the cloud to read and the file to write."""
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .pcd, .e57, .npz)")
    text = "file to write; its ending gives the format"
    parser.add_argument("--output", required=True, type=Path, metavar="FILE", help=text)


def _info_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `cloud info`."""
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .pcd, .e57, .npz)")
    text = "radius of the neighbourhood for the roughness, m (0.5)"
    parser.add_argument("--radius", type=_positive, default=0.5, metavar="M", help=text)
    text = "points per class that the roughness is computed from (5000; 0: no roughness)"
    count = whole_number(10_000_000, "10 million")
    parser.add_argument("--samples", type=count, default=5000, metavar="N", help=text)


def _preview_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `cloud preview`."""
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .pcd, .e57, .npz)")
    text = "folder for the pictures; with --picture a .png file"
    parser.add_argument("--output", required=True, type=Path, metavar="DIR_OR_FILE", help=text)
    kinds = ("class", "predicted", "intensity", "rgb", "section")
    text = f"draw only this picture: {', '.join(kinds)} (all that the cloud has)"
    parser.add_argument("--picture", choices=kinds, metavar="KIND", help=text)
    parser.add_argument("--station", type=float, metavar="M", help="of the cross-section, m (the middle)")
    parser.add_argument("--centerline", type=Path, metavar="FILE", help="GeoJSON line of stations (the long axis)")
    parser.add_argument("--line", type=float, nargs=4, metavar=("X1", "Y1", "X2", "Y2"), help="line of the section")
    parser.add_argument("--depth", type=_positive, default=1.0, metavar="M", help="depth of the cross-section, m (1)")
    parser.add_argument("--overwrite", action="store_true", help="replace pictures that are already there")


def _crop_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `cloud crop`."""
    names = ("X1", "Y1", "X2", "Y2")
    parser.add_argument("--box", type=float, nargs=4, metavar=names, help="smallest x and y, then largest, m")
    parser.add_argument("--heights", type=float, nargs=2, metavar=("LOW", "HIGH"), help="smallest and largest z, m")
    parser.add_argument("--polygon", type=Path, metavar="FILE", help="GeoJSON polygons in map coordinates")


def _tile_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `cloud tile`."""
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .pcd, .e57, .npz)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the tiles")
    parser.add_argument("--size", type=float, default=60.0, metavar="M", help="edge of a tile, m (60)")
    text = "keep one point per cell with this edge, m, e.g. 0.04 (all points)"
    parser.add_argument("--grid", type=float, metavar="M", help=text)
    count = whole_number(10**9, "a thousand million")
    parser.add_argument("--fewest", type=count, default=1, metavar="N", help="leave out tiles with fewer points (1)")
    text = "laz, las, ply, e57, npz (the cloud's format)"
    parser.add_argument("--format", choices=("laz", "las", "ply", "e57", "npz"), metavar="KIND", help=text)


def _merge(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud merge`; return its outcome."""
    from synthroads_addon.cloud.tools.divide import merge

    result = merge(arguments.files, arguments.output, arguments.overwrite, progress_bar(arguments))
    return 0, result, f"{result['points']:,} points of {len(arguments.files)} clouds written to {arguments.output}"


def _crop(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud crop`; return its outcome."""
    from synthroads_addon.cloud.tools.divide import crop

    box, heights = (None if part is None else tuple(part) for part in (arguments.box, arguments.heights))
    limits = (box, heights, arguments.polygon)
    result = crop(arguments.file, arguments.output, *limits, arguments.overwrite, progress_bar(arguments))
    return 0, result, f"{result['points']:,} of {result['points_read']:,} points written to {arguments.output}"


def _tile(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud tile`; return its outcome."""
    from synthroads_addon.cloud.tools.divide import tile

    settings = (arguments.size, arguments.grid, arguments.fewest, arguments.format, arguments.overwrite)
    result = tile(arguments.file, arguments.output, *settings, progress_bar(arguments))
    points = sum(row["points"] for row in result["tiles"])
    return 0, result, f"{len(result['tiles'])} tiles with {points:,} points written to {arguments.output}"


def _info(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud info`; return its outcome."""
    from synthroads_addon.cloud.formats.registry import open_cloud
    from synthroads_addon.cloud.tools.statistics import cloud_statistics

    with open_cloud(arguments.file) as cloud:
        figures = cloud_statistics(cloud, arguments.radius, arguments.samples)
    return 0, figures, table(figures)


def _subsample(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud subsample`; return its outcome."""
    from synthroads_addon.cloud.tools.convert import subsample

    settings = (arguments.grid, arguments.classes, arguments.overwrite)
    result = subsample(arguments.file, arguments.output, *settings, progress_bar(arguments))
    return 0, result, f"{result['points']:,} of {result['points_read']:,} points written to {arguments.output}"


def _map_intensity(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud map-intensity`; return its outcome."""
    from synthroads_addon.cloud.tools.convert import map_intensity

    files = (arguments.file, arguments.target, arguments.output)
    result = map_intensity(*files, arguments.per_class, arguments.overwrite, progress_bar(arguments))
    lines = [f"{result['points']:,} points written to {arguments.output}"]
    before, after = result["distance_before"], result["distance_after"]
    lines.append(f"largest gap between the distributions (Kolmogorov-Smirnov): {before:.4f} before, {after:.6f} after")
    lines += [f"  {name}: {gap:.6f}" for name, gap in result.get("class_distances", {}).items()]
    if result.get("classes_mapped_together"):
        names = ", ".join(result["classes_mapped_together"])
        lines.append(f"not in the target, mapped together on all its points: {names}")
    return 0, result, "\n".join(lines)


def _convert(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud convert`; return its outcome."""
    from synthroads_addon.cloud.tools.convert import convert

    result = convert(arguments.file, arguments.output, arguments.classes, arguments.overwrite, progress_bar(arguments))
    lines = [f"{result['points']:,} points written to {arguments.output}"]
    if result["left_out"]:
        lines.append(f"left out, for want of a meaning here: {', '.join(result['left_out'])}")
    return 0, result, "\n".join(lines)


def _preview(arguments: argparse.Namespace) -> Outcome:
    """Run `cloud preview`; return its outcome."""
    from synthroads_addon.cloud.formats.registry import open_cloud
    from synthroads_addon.cloud.tools.convert import draw_previews, read_centerline

    line = None
    if arguments.centerline:
        with open_cloud(arguments.file) as cloud:
            line = read_centerline(arguments.centerline, cloud.header.place)
    result = draw_previews(
        arguments.file,
        arguments.output,
        line=tuple(arguments.line) if arguments.line else None,
        station=arguments.station,
        centerline=line,
        depth=arguments.depth,
        overwrite=arguments.overwrite,
        picture=arguments.picture,
    )
    folder = arguments.output.parent if arguments.output.name in result["pictures"] else arguments.output
    lines = [f"{name} shows {field}" for name, field in result["fields"].items()]
    return 0, result, "\n".join([*lines, f"written to {folder}"])


def _positive(text: str) -> float:
    """Return a length above 0 and up to 1000 m: a type for argparse."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= 1000:
        raise argparse.ArgumentTypeError(f"is '{text}': must be above 0, at most 1000 m")
    return value


if __name__ == "__main__":
    entry("cloud")
