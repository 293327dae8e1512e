"""The signals that end a process: what is asked to end ends with one line, and leaves nothing half-written."""

import _thread
import math
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import FrameType, TracebackType

INTERRUPTED = "interrupted; nothing was left half-written"
EXIT_CODE = 130
"""Exit code of a process that was interrupted."""
MAPPING_FAILED = "failed to map segment"
"""Part of what the system says where a library doesn't fit into memory."""
_stopped = False
_AGAIN = 0.05
"""Seconds until an interrupt that came inside a callback is tried again."""
_ONCE = 3.0
"""Seconds in which several signals are one: `timeout` and Slurm send theirs to a process and to its group."""
_ended_at = -math.inf
_OPERATORS = str(Path("modules", "bpy", "ops.py"))


ENDS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals by which a command is ended: Ctrl-C; a container, Slurm or `kill`; a terminal or connection that goes."""


def was_stopped() -> bool:
    """Return whether a signal told the command to end, even if a library turned that into another exception."""
    return _stopped


def _stop(number: int, frame: FrameType | None) -> None:
    """Signal handler: raise KeyboardInterrupt in the main thread, once for signals that come together."""
    global _stopped, _ended_at
    _stopped = True
    if time.monotonic() < _ended_at + _ONCE:
        return
    if _in_callback(frame):
        retry = threading.Timer(_AGAIN, _thread.interrupt_main, (number,))
        retry.daemon = True
        retry.start()
        return
    _ended_at = time.monotonic()
    signal.default_int_handler(signal.SIGINT, frame)


def ignore_end_signals() -> None:
    """Ignore all further end signals, as the process only has to clean up and end."""
    for number in ENDS:
        with suppress(ValueError):  # not in the main thread
            signal.signal(number, signal.SIG_IGN)


def _in_callback(frame: FrameType | None) -> bool:
    """Return whether Python is being called by a Blender operator, which would swallow an exception raised there."""
    innermost = frame
    while frame is not None:
        if frame.f_code.co_filename.endswith(_OPERATORS) and frame is not innermost:
            return True
        frame = frame.f_back
    return False


def _exit_with_one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Exception hook: end the process with one line where it was stopped (130) or lacks memory (2) while loading."""
    if not _stopped and (isinstance(error, MemoryError) or MAPPING_FAILED in str(error)):
        with suppress(OSError):
            print(f"error: too little memory ({str(error)[-200:] or 'it is full'})", file=sys.stderr, flush=True)
        os._exit(2)
    if not issubclass(kind, KeyboardInterrupt) and not _stopped:
        sys.__excepthook__(kind, error, trace)
        return
    with suppress(OSError):  # the terminal is gone
        print(INTERRUPTED, file=sys.stderr, flush=True)
    os._exit(EXIT_CODE)


def handle_end_signals() -> None:
    """Have this process, a command, end with one line where a signal ends it or memory is short while it loads."""
    sys.excepthook = _exit_with_one_line
    for number in ENDS:
        # One that is ignored stays so: `nohup` and a shell's background jobs ask for that.
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _stop)
