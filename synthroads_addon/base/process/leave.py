"""The end of a process of ours, at once when its work is done, without Blender's teardown, which can crash."""

import io
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from ..scratch.folders import remove_scratch_folders, temporary_files_in_scratch
from .end_signals import EXIT_CODE, INTERRUPTED, ignore_end_signals, was_stopped


def say_interrupted() -> int:
    """Print that the work was interrupted, and return the exit code of that."""
    with suppress(OSError):  # the terminal is gone
        print(INTERRUPTED, file=sys.stderr, flush=True)
    return EXIT_CODE


def leave(action: Callable[[], int], report_interrupt: Callable[[], int] = say_interrupted) -> NoReturn:
    """Run an action and end the process at once with its exit code, without Blender's teardown.

    Args:
        action: returns the exit code.
        report_interrupt: says that it was interrupted, and returns the exit code of that.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files may hold what the terminal's encoding doesn't
            stream.reconfigure(errors="backslashreplace")
    try:
        with temporary_files_in_scratch():
            code = action()
    except KeyboardInterrupt:  # before the command's own work began, or at its very end
        code = report_interrupt()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 0 if error.code is None else 1
    except BaseException:
        if was_stopped():
            code = report_interrupt()
        else:
            import traceback  # hardly ever needed

            traceback.print_exc()
            code = 1
    ignore_end_signals()
    remove_scratch_folders()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # the terminal is gone
            stream.flush()
    os._exit(code)
