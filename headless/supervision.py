"""A command's work in a process of its own: however the system ends that, one line is said and nothing is left.

Where memory is short libraries in other languages abort or crash, and the system kills; no Python code of the process
itself can answer then. So the command's own process waits, with nothing loaded that could fail, hands signals on, and
cleans up. On Linux alone; elsewhere the work is done in the process that was begun.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import threading
import traceback
from contextlib import suppress
from functools import partial
from typing import NoReturn

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.process.end_signals import ENDS
from synthroads_addon.base.scratch.folders import record_folders_in, remove_recorded_folders
from synthroads_addon.base.scratch.opened_file import note_opened_file_in, noted_file

LOSSES = (
    *("bad_alloc", "alloc returns null", "annot allocate memory", "emory allocation"),
    *("Thread creation failed", "pthread_create has failed"),
)
"""Parts of what libraries write on standard error where memory is short."""
_BEGINNINGS = (
    *("terminate called", "Fatal Python error", "ERROR CAUGHT IN EMBREE", *LOSSES),
    # Written by Python itself where it is too short of memory to find `sys.stderr`.
    *("lost sys.stderr", "Traceback (most recent call last)", "MemoryError"),
)
"""Parts of the first line of what they write before they end the process."""
_CRASHES = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL)
_DEATH_SIGNAL = 1
"""Linux's PR_SET_PDEATHSIG."""


def supervise() -> None:
    """Fork: go on in the child; the parent waits, cleans up if the child is killed, and ends with its exit code.

    An end by the system is told in a line, as exit code 2 where memory is short and 1 where it isn't. Within Blender,
    and beside other threads, of which a copy would have none, nothing is done.
    """
    if "bpy" in sys.modules or threading.active_count() > 1:
        return
    journal, opened_file = os.memfd_create("synthroads"), os.memfd_create("synthroads-opened")
    error_pipe = _ErrorPipe()
    handlers = {number: signal.getsignal(number) for number in ENDS}
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)
    child = os.fork()
    if child:
        _wait_and_exit(child, error_pipe, journal, opened_file)
    _die_with_parent(os.getppid())
    error_pipe.redirect()
    record_folders_in(journal)
    note_opened_file_in(opened_file)
    for number, handler in handlers.items():
        signal.signal(number, handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)


def _die_with_parent(parent: int) -> None:
    """Have Linux kill this process when its parent ends; end at once if it has ended already."""
    ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(130)


def _wait_and_exit(child: int, error_pipe: _ErrorPipe, journal: int, opened_file: int) -> NoReturn:
    """Wait for the child, passing on signals and errors, and end this process with the child's exit code."""

    def hand_on(number: int, _: object) -> None:
        """Pass a signal on to the child."""
        with suppress(ProcessLookupError):
            os.kill(child, number)

    for number in ENDS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, hand_on)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)
    listener = threading.Thread(target=error_pipe.pass_on, daemon=True)
    listener.start()
    _, status = os.waitpid(child, 0)
    listener.join(1.0)  # a process that the work has begun may still hold the other end
    code = os.waitstatus_to_exitcode(status)
    is_short = code < 0 and _memory_is_short(-code, error_pipe.held)
    remove_recorded_folders(journal)  # those that are still there
    if code < 0:
        message = None if is_short else crash_line(-code, noted_file(opened_file))
        _say(message or _line(-code, is_short))
        code = 2 if is_short or message else 1
    elif code != 2:  # else a line says it all
        _say(error_pipe.held)
    os._exit(code)


def _memory_is_short(number: int, error_text: str) -> bool:
    """Return whether a process that a signal ended probably lacked memory, by signal, limits and output."""
    limits = [resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    is_limited = any(limit != resource.RLIM_INFINITY for limit in limits)
    return number == signal.SIGKILL or is_limited or any(sign in error_text for sign in LOSSES)


def crash_line(number: int, file: str) -> str | None:
    """Return the line on a file that Blender crashed on, by the signal and the file's name; None if it wasn't one."""
    if not file or number not in _CRASHES:
        return None
    fault = f"Blender crashed as it opened it ({signal.Signals(number).name})"
    remedy = "the file is damaged, or of another Blender: save it anew"
    return f"error: {InputError(file, None, f'{fault}; {remedy}')}; nothing was left half-written\n"


def _line(number: int, is_short: bool) -> str:
    """Return the line on work that a signal ended, by its number."""
    name = signal.Signals(number).name
    if is_short:
        return f"error: too little memory (the work was ended by {name}); nothing was left half-written\n"
    return f"error: a defect of a library ended the work ({name}); nothing was left half-written\n"


def _say(text: str) -> None:
    """Write a text to standard error, without Python's buffers."""
    with suppress(OSError):  # the terminal is gone
        os.write(2, text.encode(errors="backslashreplace"))


class _ErrorPipe:
    """Pipe for what native libraries write to standard error: passed on, except from their last message before a crash.

    Attributes:
        held: what wasn't handed on.
    """

    def __init__(self) -> None:
        self.held = ""
        self._hear, self._say = os.pipe()

    def redirect(self) -> None:
        """In the child, redirect file descriptor 2 into the pipe, and tracebacks that Python code prints by itself.

        Python's ``sys.stderr`` keeps the terminal.
        """
        os.close(self._hear)
        with suppress(OSError):  # there is no standard error
            sys.stderr.flush()
            terminal = os.dup(2)
            os.dup2(self._say, 2)
            encoding = sys.stderr.encoding
            sys.stderr = os.fdopen(terminal, "w", buffering=1, encoding=encoding, errors="backslashreplace")
            # Blender's scripts print what fails while they are loaded, and may have no memory left to print it whole.
            native = os.fdopen(os.dup(2), "w", buffering=1, encoding=encoding, errors="backslashreplace")
            traceback.print_exc = partial(traceback.print_exc, file=native)
        os.close(self._say)

    def pass_on(self) -> None:
        """In the parent, pass on the child's lines until it ends; from a crash message on, keep them in `held`."""
        os.close(self._say)
        with os.fdopen(self._hear, encoding="utf-8", errors="backslashreplace") as lines:
            for line in lines:
                if self.held or any(sign in line for sign in _BEGINNINGS):
                    self.held += line
                else:
                    _say(line)
