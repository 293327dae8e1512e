"""Work with point cloud files (LAZ, LAS, PLY, E57, NPZ): describe, thin out, map intensities, convert, draw."""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry, whole_number
from headless.messages import progress_bar
from headless.text_table import text_table

_COLUMNS = (
    ("points", "points", "{:,}"),
    ("density", "1/m2", "{:.1f}"),
    ("height_mean", "height m", "{:.2f}"),
    ("height_std", "std", "{:.2f}"),
    ("roughness", "roughness", "{:.4f}"),
    ("intensity_mean", "intensity", "{:.3f}"),
    ("intensity_std", "std", "{:.3f}"),
    ("luminance_mean", "luminance", "{:.3f}"),
    ("luminance_std", "std", "{:.3f}"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads cloud` and its tools to the parser."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    _info_arguments(tools.add_parser("info", help="figures of all points and of each class"))
    thin = tools.add_parser("subsample", help="keep one point per cell of a grid")
    _file_arguments(thin)
    thin.add_argument("--grid", type=float, default=0.04, metavar="M", help="edge of a cell, m (0.04)")
    mapping = tools.add_parser("map-intensity", help="map intensities on the distribution of another cloud")
    _file_arguments(mapping)
    mapping.add_argument("--target", required=True, type=Path, metavar="FILE", help="cloud with the wanted intensities")
    mapping.add_argument("--per-class", action="store_true", help="each class on the target's class of that name")
    change = tools.add_parser("convert", help="write another format, or merged classes")
    _file_arguments(change)
    _preview_arguments(tools.add_parser("preview", help="draw from above and a cross-section"))
    for tool in (thin, change):
        tool.add_argument("--classes", metavar="NAME_OR_FILE", help="5, or a .json file of classes (the cloud's own)")
    for tool in (thin, mapping, change):
        tool.add_argument("--overwrite", action="store_true", help="replace a file that is already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run a tool of `synthroads cloud`; return exit code, result as JSON data and printed text."""
    actions = {"info": _info, "subsample": _subsample, "map-intensity": _map_intensity, "convert": _convert}
    return actions.get(arguments.tool, _preview)(arguments)


def table(figures: dict[str, Any]) -> str:
    """Return a cloud's statistics as text: extent, attributes, and a table of figures by class."""
    lines = [f"{figures['file']}: {figures['kind']}, {figures['points']:,} points"]
    lines.append(f"coordinate system {'EPSG:' + str(figures['epsg']) if figures['epsg'] else 'not named'}")
    if figures["bounds"]:
        low, high = figures["bounds"]["low"], figures["bounds"]["high"]
        spans = " x ".join(f"{b - a:.1f}" for a, b in zip(low, high, strict=True))
        lines.append(f"from {low} to {high}: {spans} m")
    lines.append(f"attributes: {', '.join(figures['attributes']) or 'none beyond the usual ones'}")
    if figures["left_out"]:
        lines.append(f"not read: {', '.join(figures['left_out'])}")
    rows = [("", *(title for _, title, _ in _COLUMNS))]
    for name, values in {"all": figures["all"], **figures["classes"]}.items():
        if values:
            shown = (form.format(values[key]) if values[key] is not None else "-" for key, _, form in _COLUMNS)
            rows.append((name, *shown))
    return "\n".join([*lines, *text_table(rows[0], rows[1:], range(1, len(rows[0])))])


def _file_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .e57, .npz)")
    parser.add_argument("--output", required=True, type=Path, metavar="FILE", help="file to write; its ending decides")


def _info_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .e57, .npz)")
    text = "of roughness's neighbourhood, m (0.5)"
    parser.add_argument("--radius", type=_positive, default=0.5, metavar="M", help=text)
    text = "points per class for the roughness (5000; 0: none)"
    count = whole_number(10_000_000, "10 million")
    parser.add_argument("--samples", type=count, default=5000, metavar="N", help=text)


def _preview_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="cloud (.laz, .las, .ply, .e57, .npz)")
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the pictures")
    parser.add_argument("--station", type=float, metavar="M", help="where to cut, m along the line (the middle)")
    parser.add_argument("--centerline", type=Path, metavar="FILE", help="GeoJSON line of the stations (the long axis)")
    parser.add_argument("--line", type=float, nargs=4, metavar=("X1", "Y1", "X2", "Y2"), help="cut along this line")
    parser.add_argument("--depth", type=_positive, default=1.0, metavar="M", help="thickness of the cut, m (1)")
    parser.add_argument("--overwrite", action="store_true", help="replace pictures that are already there")


def _info(arguments: argparse.Namespace) -> Outcome:
    from synthroads_addon.cloud.formats.registry import open_cloud
    from synthroads_addon.cloud.tools.statistics import cloud_statistics

    with open_cloud(arguments.file) as cloud:
        figures = cloud_statistics(cloud, arguments.radius, arguments.samples)
    return 0, figures, table(figures)


def _subsample(arguments: argparse.Namespace) -> Outcome:
    from synthroads_addon.cloud.tools.convert import subsample

    settings = (arguments.grid, arguments.classes, arguments.overwrite)
    done = subsample(arguments.file, arguments.output, *settings, progress_bar(arguments))
    return 0, done, f"{done['points']:,} of {done['points_read']:,} points written to {arguments.output}"


def _map_intensity(arguments: argparse.Namespace) -> Outcome:
    from synthroads_addon.cloud.tools.convert import map_intensity

    files = (arguments.file, arguments.target, arguments.output)
    done = map_intensity(*files, arguments.per_class, arguments.overwrite, progress_bar(arguments))
    lines = [f"{done['points']:,} points written to {arguments.output}"]
    before, after = done["distance_before"], done["distance_after"]
    lines.append(f"largest gap between the distributions (Kolmogorov-Smirnov): {before:.4f} before, {after:.6f} after")
    lines += [f"  {name}: {gap:.6f}" for name, gap in done.get("class_distances", {}).items()]
    if done.get("classes_mapped_together"):
        names = ", ".join(done["classes_mapped_together"])
        lines.append(f"not in the target, mapped together on all its points: {names}")
    return 0, done, "\n".join(lines)


def _convert(arguments: argparse.Namespace) -> Outcome:
    from synthroads_addon.cloud.tools.convert import convert

    done = convert(arguments.file, arguments.output, arguments.classes, arguments.overwrite, progress_bar(arguments))
    lines = [f"{done['points']:,} points written to {arguments.output}"]
    if done["left_out"]:
        lines.append(f"left out, for want of a meaning here: {', '.join(done['left_out'])}")
    return 0, done, "\n".join(lines)


def _preview(arguments: argparse.Namespace) -> Outcome:
    from synthroads_addon.cloud.tools.convert import draw_previews, read_centerline

    done = draw_previews(
        arguments.file,
        arguments.output,
        line=tuple(arguments.line) if arguments.line else None,
        station=arguments.station,
        centerline=read_centerline(arguments.centerline) if arguments.centerline else None,
        depth=arguments.depth,
        overwrite=arguments.overwrite,
    )
    return 0, done, f"{', '.join(done['pictures'])} written to {arguments.output}"


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value <= 1000:
        raise argparse.ArgumentTypeError(f"is '{text}': must be above 0, at most 1000 m")
    return value


if __name__ == "__main__":
    entry("cloud")
