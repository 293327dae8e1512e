"""Options that several commands have, what they mean for a scenario, and the types of their values."""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from synthroads_addon.base.errors import InputError, nearest_name

if TYPE_CHECKING:
    from synthroads_addon.jobs.axis_points import PathPlace

AXIS_FILES = (
    "centreline: OpenDRIVE, LandXML, IFC, OpenStreetMap, GeoPackage, shapefile, FlatGeobuf, SBET, KML, GPX, "
    "CSV (x, y, z in order) or GeoJSON"
)
"""Files that an axis is read from, for the help of commands."""


def add_changes_argument(
    parser: argparse.ArgumentParser, owner: str = "the scenario", example: str = "road.length=800"
) -> None:
    """Add the option ``--set PATH=VALUE``, which can be repeated; values are collected in ``changes``."""
    text = f"change one field of {owner}, e.g. {example} (can be repeated)"
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", dest="changes", help=text)


def all_changes(arguments: argparse.Namespace, path_of_option: Mapping[str, str]) -> list[str]:
    """Return the scenario changes (``path=value``) of ``--set`` and of options that are short for fields.

    Args:
        arguments: of the command.
        path_of_option: name of an option's argument -> path of its field; options that aren't given are None or empty.

    Raises:
        InputError: an option and ``--set`` contradict each other.
    """
    from synthroads_addon.base.changes import apply_change
    from synthroads_addon.scenario.scenario import Scenario

    changed_data: Any = {}
    for change in arguments.changes:
        changed_data = apply_change(changed_data, change, Scenario)
    changes = list(arguments.changes)
    for name, path in path_of_option.items():
        value = getattr(arguments, name)
        if value in (None, []):
            continue
        set_value = changed_data
        for key in path.split("."):
            set_value = set_value.get(key, value) if isinstance(set_value, dict) else value
        if set_value != value:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, value, f"contradicts --set {path}={set_value}; leave one of the two out")
        changes.append(f"{path}={json.dumps(value)}")
    return changes


def add_device_argument(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--device NAME``, a short form of the scenario's field ``scan.device``."""
    text = "scanner: a preset's name (`synthroads list devices`) or a .json file (the scenario's own)"
    parser.add_argument("--device", metavar="NAME", help=text)


def add_allow_large_argument(parser: argparse.ArgumentParser) -> None:
    """Add the flag ``--allow-large``, which lifts the scenario's limit ``scan.most_pulses``."""
    from synthroads_addon.scenario.scan import MOST_POSSIBLE

    text = "allow a scan of any size; without it, a scan of more pulses than scan.most_pulses is refused"
    parser.add_argument("--allow-large", action="store_const", const=MOST_POSSIBLE, help=text)


def add_choice_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--tolerance`` and ``--time-budget``, by which the job chooses its settings itself."""
    from synthroads_addon.scenario.tolerance import KINDS

    kinds = ", ".join(KINDS)
    parser.add_argument(
        "--tolerance",
        metavar="KIND=VALUE,...",
        help=f"choose the fastest settings that keep these errors, e.g. height=5mm,intensity=5%%; kinds: {kinds} "
        "(the fidelity's settings)",
    )
    parser.add_argument(
        "--time-budget",
        metavar="TIME",
        help="choose the best settings that fit this time, e.g. 60s or 2min (the fidelity's settings)",
    )


def choice_changes(arguments: argparse.Namespace) -> list[str]:
    """Return the scenario changes (``path=value``) that ``--tolerance`` and ``--time-budget`` stand for."""
    from synthroads_addon.scenario.tolerance import TIMES, parse_tolerance, with_unit

    changes = []
    if arguments.tolerance is not None:
        changes.append(f"tolerance={json.dumps(parse_tolerance(arguments.tolerance))}")
    if arguments.time_budget is not None:
        changes.append(f"time_budget={with_unit('--time-budget', arguments.time_budget, TIMES)}")
    if changes and arguments.fidelity:
        raise InputError("--fidelity", arguments.fidelity, "can't be given with a choice of the settings it stands for")
    return changes


def choice_summary(report: dict[str, Any]) -> list[str]:
    """Return lines of text on settings chosen and errors expected; empty if the report has no choice."""
    if "choice" not in report:
        return []
    from synthroads_addon.scenario.tolerance import error_text

    choice = report["choice"]
    settings = ", ".join(f"{path}={value}" for path, value in choice["chosen"].items())
    errors = ", ".join(f"{name} {error_text(name, value)}" for name, value in choice["expected"]["errors"].items())
    at_most = ", ".join(f"{name} {error_text(name, value)}" for name, value in choice["expected"]["at_most"].items())
    lines = [f"chosen: {settings or 'nothing, as all is given'} ({choice['by']})", f"  expected errors: {errors}"]
    lines += [f"  at most, with a confidence of 95 %: {at_most}"] if at_most else []
    seconds = choice["expected"]["seconds"]
    return lines + ([f"  expected time: {seconds:.0f} s in all"] if seconds is not None else [])


def add_axis_name_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--axis-name``, which chooses one of a file's roads, and where the axis lies beside a line of points."""
    text = "name of a road or alignment in the file (the longest); `synthroads road FILE --list` lists them"
    parser.add_argument("--axis-name", metavar="NAME", help=text)
    text = "distance from the file's points to the axis, m; positive: axis to their left, along their order (0)"
    parser.add_argument("--offset-from-path", type=float, metavar="METRES", help=text)
    text = "lane in whose middle the file's points run, 0: the outermost (instead of --offset-from-path)"
    parser.add_argument("--path-lane", type=int, metavar="N", help=text)
    text = "height of the file's points above the road, m; add the geoid height if their heights are ellipsoidal"
    parser.add_argument("--height-above-road", type=float, metavar="METRES", help=text)


def axis_place(arguments: argparse.Namespace) -> "PathPlace":
    """Return where the axis lies beside a file's points, by the arguments that `add_axis_name_argument` declares."""
    from synthroads_addon.jobs.axis_points import FARTHEST_ABOVE, FARTHEST_ASIDE, PathPlace

    place = PathPlace(arguments.offset_from_path, arguments.path_lane, arguments.height_above_road)
    limits = (
        ("offset-from-path", place.offset, FARTHEST_ASIDE),
        ("height-above-road", place.height, FARTHEST_ABOVE),
    )
    for option, value, most in limits:
        if value is not None and not abs(value) <= most:
            raise InputError(f"--{option}", value, f"a length of at most {most:g} m to either side is needed")
    return place


def add_twin_argument(parser: argparse.ArgumentParser, default: Sequence[str] = ()) -> None:
    """Add the option ``--twin FORMATS``: names of formats separated by commas, as a list in ``twin``."""
    from synthroads_addon.twin.formats import TWIN_FORMATS

    text = f"geometric-semantic models, separated by commas: {', '.join(TWIN_FORMATS)} ({','.join(default) or 'none'})"
    parser.add_argument("--twin", type=_split_names, default=list(default), metavar="FORMATS", help=text)


def add_cloud_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--cloud`` and ``--sweeps``: formats of the cloud, and of sweeps with boxes, separated by commas."""
    from synthroads_addon.cloud.formats.registry import ENDINGS
    from synthroads_addon.cloud.sweeps.registry import SWEEP_FORMATS

    clouds = ", ".join(ending.removeprefix(".") for ending in ENDINGS)
    text = f"formats of the cloud, separated by commas: {clouds} (the scenario's own)"
    parser.add_argument("--cloud", type=_split_names, default=[], metavar="FORMATS", help=text)
    text = f"sweeps with boxes and labels, separated by commas: {', '.join(SWEEP_FORMATS)} (the scenario's own)"
    parser.add_argument("--sweeps", type=_split_names, default=[], metavar="FORMATS", help=text)


def add_formats_argument(parser: argparse.ArgumentParser, *kinds: str) -> None:
    """Add ``--formats``, which lists the formats that a command writes and ends it, as ``--help`` does.

    Args:
        parser: of the command.
        kinds: of formats, as `format_losses` has them, that the command writes.
    """

    class ListFormats(argparse.Action):
        def __call__(self, parser: argparse.ArgumentParser, _: Any, names: Any, option: str | None = None) -> None:
            # What a cloud's formats lose is measured, for which their writers are imported.
            from headless.list import listing
            from synthroads_addon.jobs.format_losses import format_names

            known = format_names(kinds)
            for name in names or ():
                if name not in known:
                    allowed = f"must be one of {', '.join(known)}{nearest_name(name, known)}"
                    parser.error(f"{option} is '{name}': {allowed}")
            for line in listing("formats", names or known):
                print(line)
            parser.exit()

    text = "list the formats (FORMATS, or all) with what each holds and loses, and end"
    parser.add_argument("--formats", action=ListFormats, nargs="?", type=_split_names, metavar="FORMATS", help=text)


def _split_names(text: str) -> list[str]:
    """Return the names in a list separated by commas, without repetitions, in order."""
    return list(dict.fromkeys(text.split(",")))


def add_renamed_argument(parser: argparse.ArgumentParser, former: str, name: str) -> None:
    """Add an option's former name, hidden from help, which ends the command with a hint at the new name."""

    class Renamed(argparse.Action):
        def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
            parser.error(f"{former} is now {name}")

    parser.add_argument(former, action=Renamed, nargs="?", help=argparse.SUPPRESS)


def numbers(counts: Sequence[int], form: str) -> Callable[[str], tuple[float, ...]]:
    """Return an argparse type that reads numbers (m) separated by commas, as many as one of ``counts`` allows."""

    def read(text: str) -> tuple[float, ...]:
        try:
            values = tuple(float(part) for part in text.split(","))
        except ValueError:
            values = ()
        if len(values) not in counts or not all(abs(value) < 1e9 for value in values):
            raise argparse.ArgumentTypeError(f"is '{text}': must be {form} in metres")
        return values

    return read


def whole_number(most: int, limit_text: str) -> Callable[[str], int]:
    """Return an argparse type that reads a whole number from 0 to a maximum."""

    def read(text: str) -> int:
        if not text.isascii() or not text.isdigit() or int(text) > most:
            raise argparse.ArgumentTypeError(f"is '{text}': must be a whole number from 0 to {limit_text}")
        return int(text)

    return read
