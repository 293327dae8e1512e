"""Compare expected intensities of materials with a real cloud's; fit the materials, save them to a table, plot them.

With labels:     synthroads calibrate --real CLOUD --material asphalt=road --material paint_white=road_marking
Beside an axis:  synthroads calibrate --real CLOUD --axis CSV --paved=-7,-1 --line=-4 \\
                     --material asphalt=paved --material paint_white=line
Without a cloud: synthroads calibrate --material asphalt --incidence-deg 0,30,60 --range 50
"""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.options import numbers
from headless.progress import progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target
from synthroads_addon.base.progress import exhaust
from synthroads_addon.calibration.job import (
    PARTS,
    Calibration,
    CalibrationJob,
    MaterialTarget,
    calibration_steps,
    check_job,
    save_fitted,
)
from synthroads_addon.calibration.sensor_files import fit_sensor, save_device, save_recipe
from synthroads_addon.cloud.selection.pavement import RoadClasses

_SAME = (
    *("table", "real", "class_field", "device", "incidence_deg", "ranges", "scanner", "reflection", "attenuation"),
    *("range_corrected", "decibels", "device_response", "hold", "gain"),
)
"""Arguments that a calibration's job has under the same name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads calibrate` to its parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    text = "material of the table, and its class in the cloud: a number, a name, paved or line (can be repeated)"
    parser.add_argument("--material", action="append", required=True, metavar="NAME[=CLASS]", help=text)
    _cloud_arguments(parser.add_argument_group("the real cloud"))
    _view_arguments(parser.add_argument_group("how it was seen"))
    _fit_arguments(parser.add_argument_group("the fit"))
    files = parser.add_argument_group("files")
    files.add_argument("--table", type=Path, metavar="FILE", help="material table to start from (the shipped one)")
    files.add_argument("--save", type=Path, metavar="FILE", help="write the fitted materials to this table (.json)")
    text = "write a device with the response, noise and spacing of the first material's points (.json)"
    files.add_argument("--save-device", type=Path, metavar="FILE", help=text)
    text = "write a recipe that scans roads with the saved device and the fitted materials (.yaml)"
    files.add_argument("--save-recipe", type=Path, metavar="FILE", help=text)
    text = "compute the sensor from formulas only, without refining it by simulated scans"
    files.add_argument("--formulas", action="store_true", help=text)
    files.add_argument("--plot", type=Path, metavar="FILE", help="draw the distributions (.png)")
    files.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def _cloud_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the arguments that say where the real cloud's classes are."""
    group.add_argument("--real", type=Path, metavar="CLOUD", help="compare with this cloud (.laz, .las, .ply, ...)")
    text = "extra attribute of the cloud that holds the classes (its classification)"
    group.add_argument("--class-field", metavar="NAME", help=text)
    group.add_argument("--axis", type=Path, metavar="FILE", help="axis of the cloud's road; offsets give the classes")
    text = "range of offsets that is pavement, m, positive to the left (can be repeated)"
    pair = numbers((2,), "FROM,TO")
    group.add_argument("--paved", type=pair, action="append", default=[], metavar="FROM,TO", help=text)
    text = "offset of a marking, m (can be repeated)"
    group.add_argument("--line", type=numbers((1,), "a number"), action="append", default=[], metavar="M", help=text)
    group.add_argument("--line-width", type=float, default=0.15, metavar="M", help="width of the markings, m (0.15)")


def _view_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the arguments on device, angles, ranges and reflection."""
    group.add_argument("--device", metavar="NAME", help="preset or file with the beam divergence (0)")
    text = "incidence angles, degrees (0)"
    group.add_argument("--incidence-deg", type=_numbers, default=(0.0,), metavar="D,D,...", help=text)
    text = "ranges, m (60)"
    group.add_argument("--range", type=_numbers, default=(60.0,), metavar="M,M,...", help=text, dest="ranges")
    text = "position of the scanner, instead of --range and --incidence-deg"
    group.add_argument("--scanner", type=numbers((3,), "X,Y,Z"), metavar="X,Y,Z", help=text)
    reflections = ("lambert", "oren_nayar")
    group.add_argument("--reflection", choices=reflections, default="lambert", help="reflection model (lambert)")
    group.add_argument("--attenuation", type=float, default=0.0, metavar="1/M", help="by the air, both ways (0)")
    group.add_argument("--range-corrected", action="store_true", help="the device corrects intensities for range")
    group.add_argument("--decibels", type=float, metavar="DB", help="the 16-bit values span this many dB (linear)")
    text = "compute intensities as the device's file says: range-compensated, compressed, or in decibels"
    group.add_argument("--device-response", action="store_true", help=text)
    text = "take a material's colours from an image of a surface M metres wide (1; can be repeated)"
    group.add_argument("--texture", action="append", default=[], metavar="NAME=IMAGE[@M]", help=text)


def _fit_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the arguments on what is fitted."""
    group.add_argument("--no-fit", action="store_true", help="compare only; fit nothing but the gain")
    text = f"fit these besides the brightness: {', '.join(PARTS)}, or none (spread,wavelength)"
    group.add_argument("--fit", metavar="PART,...", default="spread,wavelength", help=text)
    group.add_argument("--hold", metavar="NAME", help="keep this material's brightness and fit the gain to it")
    group.add_argument("--gain", type=float, metavar="G", help="the device's gain, known from another cloud (free)")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads calibrate`; return exit code, result as JSON data and printed text."""
    job = job_of(arguments)
    files = {
        "--save": (arguments.save, ".json"),
        "--save-device": (arguments.save_device, ".json"),
        "--save-recipe": (arguments.save_recipe, ".yaml"),
        "--plot": (arguments.plot, ".png"),
    }
    for field, (path, ending) in files.items():
        if path:
            check_file_target(path, field, arguments.overwrite, ending)
        if path and field.startswith("--save") and (job.real is None or not job.fit):
            raise InputError(field, str(path), "needs a cloud that materials are fitted to")
    if arguments.save_recipe and not arguments.save_device:
        raise InputError("--save-recipe", str(arguments.save_recipe), "needs --save-device, which it scans with")
    check_job(job)
    progress = progress_bar(arguments)
    result = exhaust(calibration_steps(job), lambda share: progress("calibrate", share))
    if arguments.save_device:
        progress("sensor", 0.0)
    sensor = fit_sensor(result, not arguments.formulas) if arguments.save_device else None
    if arguments.save:
        # Scans by the recipe have the sensor's noise beside the materials' own spread.
        fitted_materials = sensor.materials if sensor and arguments.save_recipe else None
        save_fitted(result, arguments.save, arguments.overwrite, fitted_materials)
    if arguments.plot:
        from synthroads_addon.calibration.plot import save_plot

        save_plot(result, arguments.plot, arguments.overwrite)
    data, lines = result.to_dict(), summary(result)
    if sensor:
        save_device(sensor, arguments.save_device, arguments.overwrite)
        if arguments.save_recipe:
            device, table = arguments.save_device, arguments.save
            save_recipe(sensor, arguments.save_recipe, device, table, arguments.overwrite)
        data |= {"sensor": sensor.to_dict()}
        lines += [f"{name}: {value}" for name, value in data["sensor"]["estimate"].items() if value is not None]
    paths = [str(path) for path, _ in files.values() if path]
    return 0, data, "\n".join([*lines, *(f"written: {path}" for path in paths)])


def job_of(arguments: argparse.Namespace) -> CalibrationJob:
    """Return the calibration job that the command line's arguments describe."""
    textures = dict(_texture(text) for text in arguments.texture)
    targets = [_parse_target(text, textures) for text in arguments.material]
    unknown_names = set(textures) - {target.material for target in targets}
    if unknown_names:
        raise InputError("--texture", sorted(unknown_names)[0], "must be one of the materials asked for")
    if arguments.axis is None and (arguments.paved or arguments.line):
        raise InputError("--axis", None, "is needed with --paved and --line")
    road = None
    if arguments.axis is not None:
        lines = tuple(offset for (offset,) in arguments.line)
        road = RoadClasses(arguments.axis, tuple(arguments.paved), lines, arguments.line_width)
    copied_values = {name: getattr(arguments, name) for name in _SAME}
    parts = frozenset(_parts(arguments.fit))
    return CalibrationJob(targets=tuple(targets), road=road, fit=not arguments.no_fit, parts=parts, **copied_values)


def summary(result: Calibration) -> list[str]:
    """Return a calibration's result as lines of text: gain, reflectivities, percentiles and fitted values."""
    data = result.to_dict()
    lines = [f"gain {data['gain']:g}, one for all classes"] if data["real"] else []
    for row in data["classes"]:
        lines.append(f"{row['material']}: reflectivity {row['reflectivity'][0]:.3f} -> {row['reflectivity'][1]:.3f}")
        if "real" in row:
            lines.append(f"  {row['points']:,} points, {row['zeros_left_out']:,} zeros left out; {row['told_by']}")
        lines += _table(row)
        changed_values = {name: value for name, value in row["after"].items() if row["before"].get(name) != value}
        if changed_values:
            lines.append(f"  fitted: {', '.join(f'{name} {value}' for name, value in changed_values.items())}")
    return lines


def _table(row: dict[str, Any]) -> list[str]:
    """Return lines of text with a class's percentiles, real and expected, and those of its views."""
    lines = ["  percentile" + "".join(f"{name:>12}" for name in row["expected"])]
    for name in ("real", "expected"):
        if name in row:
            lines.append(f"  {name:<10}" + "".join(f"{value:>12,.6g}" for value in row[name].values()))
    errors = row.get("error_of_interquartile_range", {})
    if errors:
        cells = (f"{errors[name]:>12.2%}" if name in errors else " " * 12 for name in row["expected"])
        lines.append("  error/IQR " + "".join(cells))
    names = ("25", "50", "75")
    if row["views"] and not errors:
        lines.append("   incidence       range" + "".join(f"{name:>12}" for name in names))
        for view in row["views"]:
            quartiles = "".join(f"{view[name]:>12,.6g}" for name in names)
            lines.append(f"  {view['incidence_deg']:>6g} deg {view['range']:>9g} m{quartiles}")
    return lines


def _parts(text: str) -> list[Any]:
    """Return the parts to fit that a text names, separated by commas."""
    parts = [] if text == "none" else [part.strip() for part in text.split(",")]
    for part in parts:
        if part not in PARTS:
            raise InputError("--fit", part, f"must be any of {', '.join(PARTS)}, or none")
    return parts


def _parse_target(text: str, textures: dict[str, tuple[Path, float]]) -> MaterialTarget:
    """Return the material and the class that a text NAME or NAME=CLASS names."""
    name, _, real_class = text.partition("=")
    image, width = textures.get(name, (None, 1.0))
    return MaterialTarget(name, real_class or None, image, width)


def _texture(text: str) -> tuple[str, tuple[Path, float]]:
    """Return the material, image and width (m) of a text NAME=IMAGE or NAME=IMAGE@WIDTH."""
    name, equals, image = text.partition("=")
    file, _, width = image.rpartition("@") if "@" in image else (image, "", "1")
    try:
        size = float(width)
    except ValueError:
        size = -1.0
    if not equals or not file or not 0.0 < size < 1e6:
        raise InputError("--texture", text, "must be NAME=IMAGE or NAME=IMAGE@WIDTH, e.g. asphalt=road.png@2.5")
    return name, (Path(file), size)


def _numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a text, separated by commas: a type for argparse."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"is '{text}': must be numbers, e.g. 0,10,20") from None


if __name__ == "__main__":
    entry("calibrate")
