"""How a sub-command is run: its arguments, what it prints, and the exit code that an error becomes.

Exit codes: 0 done; 1 a defect of ours; 2 bad input; 3 violations found, scenes of a set failed, or a doubtful result;
130 interrupted.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from headless.error_lines import error_line, missing_package
from headless.messages import messages
from headless.parser import Parser, add_shared_options
from headless.progress import progress_display
from synthroads_addon.base.process.end_signals import EXIT_CODE, INTERRUPTED, was_stopped
from synthroads_addon.base.process.leave import leave as leave_process
from synthroads_addon.base.remarks import collected_remarks

_NEEDED = ("numpy", "pydantic")
"""Packages that stand for all that SynthRoads depends on: where one is missing it wasn't installed at all."""

if lacking := [name for name in _NEEDED if find_spec(name) is None]:  # Blender itself has none but NumPy
    print(missing_package(ModuleNotFoundError(name=lacking[0])), file=sys.stderr)
    raise SystemExit(2)

Outcome = tuple[int, dict[str, Any], str | Iterator[str]]
"""Outcome of a sub-command: exit code, result as JSON data, result as text or lines of it."""


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


def _writes_files(arguments: argparse.Namespace) -> bool:
    """Return whether a command's result goes to files, so that ``--quiet`` may drop what it prints."""
    options = ("output", "save", "plot", "document", "writes")
    return any(getattr(arguments, name, None) for name in options) and not getattr(arguments, "verify", False)


def run(action: Callable[[argparse.Namespace], Outcome], arguments: argparse.Namespace) -> int:
    """Run a sub-command and print its result as text or JSON; return the exit code; bad input becomes one line."""
    _interrupt_notes.clear()
    try:
        with _silent_standard_output(), messages(arguments), progress_display(arguments), collected_remarks():
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
        message = error_line(error)
        if message is None:
            raise
        print(message, file=sys.stderr)
        return 2


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
        terminal = os.dup(1)
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
        os.dup2(terminal, 1)
        os.close(terminal)
