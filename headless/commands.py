"""How a sub-command is run: its arguments, what it prints, and the exit code that an error becomes.

Exit codes: 0 done; 1 a defect of ours; 2 bad input; 3 violations found, scenes of a set failed, or a doubtful result;
130 interrupted.
"""

import argparse
import errno
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from headless.messages import messages
from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.process.end_signals import EXIT_CODE, INTERRUPTED, MAPPING_FAILED, was_stopped
from synthroads_addon.base.process.leave import leave as leave_process
from synthroads_addon.base.remarks import collected_remarks

if TYPE_CHECKING:
    from synthroads_addon.jobs.axis_points import PathPlace

EXTRAS = {
    **dict.fromkeys(("matplotlib", "skimage", "sklearn", "torch"), "ml"),
    "ifcopenshell": "twin",
    "pye57": "e57",
    **dict.fromkeys(("osmium", "pyogrio"), "maps"),
    **dict.fromkeys(("cryptography", "dask", "dask_jobqueue", "distributed"), "cluster"),
    **dict.fromkeys(("ml_dtypes", "onnx", "onnxruntime", "onnxscript"), "onnx"),
    **dict.fromkeys(("bpy", "mathutils", "shtab", "yaml"), "blender"),
}
"""Name by which a package is imported -> extra of ours that brings it; all others come with SynthRoads itself."""
_NEEDED = ("numpy", "pydantic")
"""Packages that stand for all that SynthRoads depends on: where one is missing it wasn't installed at all."""


def missing_package(error: ModuleNotFoundError) -> str:
    """Return the error line for a package that isn't installed; re-raises the error of a module of our own."""
    name = (error.name or "").partition(".")[0]
    if name in ("", "headless", "ml", "synthroads_addon"):
        raise error
    wanted = f"synthroads[{EXTRAS[name]}]" if name in EXTRAS else "synthroads"
    within = "install and enable the SynthRoads extension in Blender, or " if name not in EXTRAS else ""
    return f"error: the package {name} is missing: {within}run pip install '{wanted}'"


if lacking := [name for name in _NEEDED if find_spec(name) is None]:  # Blender itself has none but NumPy
    print(missing_package(ModuleNotFoundError(name=lacking[0])), file=sys.stderr)
    raise SystemExit(2)

Outcome = tuple[int, dict[str, Any], str | Iterator[str]]
"""Outcome of a sub-command: exit code, result as JSON data, result as text or lines of it."""

AXIS_FILES = (
    "centreline: OpenDRIVE, LandXML, IFC, OpenStreetMap, GeoPackage, shapefile, FlatGeobuf, SBET, KML, GPX, "
    "CSV (x, y, z in order) or GeoJSON"
)
"""Files that an axis is read from, for the help of commands."""

SHORT_OPTIONS = {
    "--count": "-n",
    "--device": "-d",
    "--fidelity": "-f",
    "--jobs": "-j",
    "--output": "-o",
    "--quiet": "-q",
    "--seed": "-s",
    "--verbose": "-v",
    "--version": "-V",
}
"""Letters that stand for options, the same for all commands."""


_NEGATIVE_NUMBERS = re.compile(r"-(\.?\d|inf(inity)?$|nan$)", re.IGNORECASE)
"""Beginning of values that are no options though they begin with a dash: argparse knows neither -1e3 nor -1,2."""


class Parser(argparse.ArgumentParser):
    """Argument parser that reports errors in one line, without usage.

    Attributes:
        words: argument that takes words on both sides of options; argparse by itself ends one with ``*`` at the first.
    """

    words: str | None = None

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._negative_number_matcher = _NEGATIVE_NUMBERS

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the namespace and unknown arguments; words after options go to the argument named by `words`."""
        self._refuse_unknown_option(sys.argv[1:] if args is None else args)
        parsed, rest = super().parse_known_args(args, namespace)
        if self.words and not any(word.startswith("-") for word in rest):
            setattr(parsed, self.words, [*(getattr(parsed, self.words) or ()), *rest])
            rest = []
        return parsed, rest

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is none of an argument's choices, and name the one most like it."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            message = f"invalid choice: {value!r} (choose from {', '.join(known)}){nearest_name(str(value), known)}"
            raise argparse.ArgumentError(action, message)

    def _refuse_unknown_option(self, words: Sequence[str]) -> None:
        """End the command where a word is no option of it, before it misses others, and name the one most like it."""
        if self._subparsers is not None or "--" in words:  # its sub-commands have the options; or what follows is none
            return
        known = [name for action in self._actions if action.help != argparse.SUPPRESS for name in action.option_strings]
        for word in words:
            name = word.partition("=")[0]
            is_option = name.startswith("--") and " " not in name
            if is_option and not any(one.startswith(name) for one in self._option_string_actions):
                self.error(f"unrecognized arguments: {word}{nearest_name(name, known)}")

    def error(self, message: str) -> Any:
        self.exit(2, f"{self.prog}: {message}\n")


def add_shared_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that all commands share, and `SHORT_OPTIONS`, to a parser and its sub-parsers, in place."""
    inner = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not inner:
        _add_common_arguments(parser)
    for its_parser in (its_parser for action in inner for its_parser in action.choices.values()):
        add_shared_options(its_parser)
    for action in parser._actions:
        letters = [SHORT_OPTIONS[name] for name in action.option_strings if name in SHORT_OPTIONS]
        action.option_strings = [*letters, *action.option_strings]
        parser._option_string_actions.update(dict.fromkeys(letters, action))


def module_of(name: str) -> Any:
    """Import and return the module `headless.NAME` of a sub-command; ends the process where a package is missing."""
    try:
        return import_module(f"headless.{name}")
    except ModuleNotFoundError as error:
        print(missing_package(error), file=sys.stderr)
        raise SystemExit(2) from None


def add_arguments(module: Any, parser: argparse.ArgumentParser) -> None:
    """Add a sub-command's arguments to its parser; ends the process where a package is missing."""
    try:
        module.add_arguments(parser)
    except ModuleNotFoundError as error:
        print(missing_package(error), file=sys.stderr)
        raise SystemExit(2) from None


def command(name: str, argv: Sequence[str] | None = None) -> int:
    """Run one sub-command with its own parser, as ``python -m headless.NAME`` does; return its exit code."""
    module = module_of(name)
    parser = Parser(prog=f"synthroads {name}", description=module.__doc__)
    add_arguments(module, parser)
    add_shared_options(parser)
    return run(module.run, parser.parse_args(argv))


def add_changes_argument(
    parser: argparse.ArgumentParser, owner: str = "the scenario", example: str = "road.length=800"
) -> None:
    """Add the option ``--set PATH=VALUE``, which can be repeated; values are collected in ``changes``."""
    text = f"change one field of {owner}, e.g. {example} (can be repeated)"
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", dest="changes", help=text)


def add_device_argument(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--device NAME``, a short form of the scenario's field ``scan.device``."""
    text = "scanner: a preset's name (`synthroads list devices`) or a .json file (the scenario's own)"
    parser.add_argument("--device", metavar="NAME", help=text)


def all_changes(arguments: argparse.Namespace, short: Mapping[str, str]) -> list[str]:
    """Return the scenario changes (``path=value``) of ``--set`` and of options that are short for fields.

    Args:
        arguments: of the command.
        short: name of an option's argument -> path of its field; options that aren't given are None or empty.

    Raises:
        InputError: an option and ``--set`` contradict each other.
    """
    from synthroads_addon.base.changes import apply_change
    from synthroads_addon.scenario.scenario import Scenario

    given: Any = {}
    for change in arguments.changes:
        given = apply_change(given, change, Scenario)
    changes = list(arguments.changes)
    for name, path in short.items():
        value = getattr(arguments, name)
        if value in (None, []):
            continue
        other = given
        for key in path.split("."):
            other = other.get(key, value) if isinstance(other, dict) else value
        if other != value:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, value, f"contradicts --set {path}={other}; leave one of the two out")
        changes.append(f"{path}={json.dumps(value)}")
    return changes


def add_allow_large_argument(parser: argparse.ArgumentParser) -> None:
    """Add the flag ``--allow-large``, which lifts the scenario's limit ``scan.most_pulses``."""
    from synthroads_addon.scenario.scan import MOST_POSSIBLE

    text = "do a scan of any size: without it one of more pulses than scan.most_pulses is refused"
    parser.add_argument("--allow-large", action="store_const", const=MOST_POSSIBLE, help=text)


def add_choice_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--tolerance`` and ``--time-budget``, by which the job chooses its settings itself."""
    from synthroads_addon.scenario.tolerance import KINDS

    kinds = ", ".join(KINDS)
    parser.add_argument(
        "--tolerance",
        metavar="KIND=VALUE,...",
        help=f"choose the cheapest settings whose errors keep this, e.g. height=5mm,intensity=5%%; kinds: {kinds} "
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
    chosen = ", ".join(f"{path}={value}" for path, value in choice["chosen"].items())
    errors = ", ".join(f"{name} {error_text(name, value)}" for name, value in choice["expected"]["errors"].items())
    at_most = ", ".join(f"{name} {error_text(name, value)}" for name, value in choice["expected"]["at_most"].items())
    lines = [f"chosen: {chosen or 'nothing, as all is given'} ({choice['by']})", f"  expected errors: {errors}"]
    lines += [f"  at most, with a confidence of 95 %: {at_most}"] if at_most else []
    seconds = choice["expected"]["seconds"]
    return lines + ([f"  expected time: {seconds:.0f} s in all"] if seconds is not None else [])


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


def whole_number(most: int, shown: str) -> Callable[[str], int]:
    """Return an argparse type that reads a whole number from 0 to a maximum."""

    def read(text: str) -> int:
        if not text.isascii() or not text.isdigit() or int(text) > most:
            raise argparse.ArgumentTypeError(f"is '{text}': must be a whole number from 0 to {shown}")
        return int(text)

    return read


def add_renamed_argument(parser: argparse.ArgumentParser, former: str, name: str) -> None:
    """Add an option's former name, hidden from help, which ends the command with a hint at the new name."""

    class Renamed(argparse.Action):
        def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
            parser.error(f"{former} is now {name}")

    parser.add_argument(former, action=Renamed, nargs="?", help=argparse.SUPPRESS)


def add_axis_name_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--axis-name``, which chooses one of a file's roads, and where the axis lies beside a line of points."""
    text = "road or alignment of the file, by its name (the longest); `synthroads road FILE --list` lists them"
    parser.add_argument("--axis-name", metavar="NAME", help=text)
    text = "the axis lies so far beside the file's points, m; positive to the left in their direction (0)"
    parser.add_argument("--offset-from-path", type=float, metavar="METRES", help=text)
    text = "the file's points run in the middle of this lane, 0 the outermost (instead of --offset-from-path)"
    parser.add_argument("--path-lane", type=int, metavar="N", help=text)
    text = (
        "the file's points are so high above the road, m; with the geoid's height where they count from the ellipsoid"
    )
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

    text = f"geometric-semantic models, with commas: {', '.join(TWIN_FORMATS)} ({','.join(default) or 'none'})"
    parser.add_argument("--twin", type=_split_names, default=list(default), metavar="FORMATS", help=text)


def _split_names(text: str) -> list[str]:
    """Return the names in a list separated by commas, without repetitions, in order."""
    return list(dict.fromkeys(text.split(",")))


def _add_common_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the flags that all sub-commands share: ``--quiet``, ``--verbose``, ``--json``."""
    amount = parser.add_mutually_exclusive_group()
    text = "print errors only; if no output file is given, also print the result"
    amount.add_argument("--quiet", action="store_true", help=text)
    amount.add_argument("--verbose", action="store_true", help="print settings, versions and times of stages as well")
    parser.add_argument("--json", action="store_true", help="print the result as JSON on standard output")


def _writes_files(arguments: argparse.Namespace) -> bool:
    """Return whether a command's result goes to files, so that ``--quiet`` may drop what it prints."""
    named = ("output", "save", "plot", "document", "writes")
    return any(getattr(arguments, name, None) for name in named) and not getattr(arguments, "verify", False)


def run(action: Callable[[argparse.Namespace], Outcome], arguments: argparse.Namespace) -> int:
    """Run a sub-command and print its result as text or JSON; return the exit code; bad input becomes one line."""
    _interrupt_notes.clear()
    try:
        with _silent_standard_output(), messages(arguments), collected_remarks():
            from synthroads_addon.base.machine import prepare_memory

            prepare_memory()
            code, result, text = action(arguments)
        if arguments.json:
            from synthroads_addon.base.schema import canonical_json

            print(canonical_json(result), end="")
        elif not arguments.quiet or not _writes_files(arguments):
            for line in [text] if isinstance(text, str) else text:
                print(line)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # Whoever read our output has left (`| head`): nothing more to say, not even when the process ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 130
    except KeyboardInterrupt:
        return report_interrupt()
    except Exception as error:
        if was_stopped():  # which libraries turn into errors of their own, and workers into the loss of them
            return report_interrupt()
        told = _error_line(error)
        if told is None:
            raise
        print(told, file=sys.stderr)
        return 2


def _error_line(error: Exception) -> str | None:
    """Return the line printed for an error, or None if it is a defect of ours, which is raised."""
    if isinstance(error, InputError):
        return f"error: {error}"
    if isinstance(error, ModuleNotFoundError):
        return missing_package(error)
    reason = _name_fault(error) or _shortage_reason(error)
    return reason and f"error: {reason}"


def _name_fault(error: Exception) -> str | None:
    """Return the reason if an error means that the system takes no name as long as one that was given, else None."""
    if not isinstance(error, OSError) or error.errno != errno.ENAMETOOLONG:
        return None
    name = str(error.filename or "a file")
    shown = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}..."
    return f"{shown!r} is no name of a file: the system takes none as long ({len(name):,} characters)"


def _shortage_reason(error: Exception) -> str | None:
    """Return the reason if an error means that memory, disk space or file handles ran out, else None."""
    text = " ".join(str(error).split())
    full = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    if full or any(sign in text for sign in _MEMORY_SIGNS):
        return f"too little memory ({text[:200] or 'it is full'}); nothing was left half-written"
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{error.filename or 'a file'} cannot be opened ({error.strerror}); ulimit -n raises the limit"
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        name = error.filename or "a temporary file"
        return f"{name} cannot be written ({error.strerror}); TMPDIR names another folder"
    return None


_MEMORY_SIGNS = (
    *("can't allocate memory", "annot allocate memory", "out of memory", "can't start new thread", "bad_alloc"),
    MAPPING_FAILED,
)
"""Parts of the errors by which libraries in other languages tell that memory is short."""
_SHOWN = 80
"""Characters that are shown of a name that is too long."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


_interrupt_notes: list[Callable[[], str]] = []
"""Sentences that the command adds when it is interrupted."""


def note_at_interrupt(note: Callable[[], str]) -> None:
    """Have the rest of this command say a line when it is interrupted: what is kept, and how to go on."""
    _interrupt_notes[:] = [note]


def report_interrupt() -> int:
    """Print that the command was interrupted, what it says of that itself, and return the exit code of that."""
    with suppress(OSError):  # the terminal is gone
        print(INTERRUPTED, *(note() for note in _interrupt_notes), sep="\n", file=sys.stderr, flush=True)
    return EXIT_CODE


def entry(name: str) -> None:
    """Run a sub-command as a script, under plain Python or ``blender -b -P``, and end the process with its exit code.

    In Blender the arguments follow ``--``. The process is left at once, since Blender's teardown can crash.
    """
    in_blender = Path(sys.argv[0]).name.lower().startswith("blender")
    begin = sys.argv.index("--") + 1 if "--" in sys.argv else len(sys.argv) if in_blender else 1
    argv = sys.argv[begin:]
    leave(lambda: command(name, argv))


def leave(action: Callable[[], int]) -> NoReturn:
    """Run an action, which returns an exit code, and end the process at once with it, without Blender's teardown.

    It is done in a process of its own, where the system has them, so that an end by a signal is one line too.
    """
    if sys.platform == "linux":
        from headless.supervision import supervise  # only Unix has what it needs

        supervise()
    leave_process(action, report_interrupt)


@contextmanager
def _silent_standard_output() -> Iterator[None]:
    """Context in which whatever Blender prints to standard output is dropped; standard error still shows."""
    sys.stdout.flush()
    try:
        saved = os.dup(1)
    except OSError:  # no standard output at all
        yield
        return
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.close(silence)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(saved, 1)
        os.close(saved)
