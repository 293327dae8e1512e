"""Thin command lines over `synthroads_addon`; each module is one sub-command."""

import _thread
import os
import signal
import sys
import threading
from pathlib import Path
from types import FrameType, TracebackType

_stopped = False
_AGAIN = 0.05
"""Seconds until an interrupt that came inside a callback is tried again."""
_OPERATORS = str(Path("modules", "bpy", "ops.py"))


def was_stopped() -> bool:
    """Return whether the user has stopped the command, whatever error came of it: libraries turn Ctrl-C into others."""
    return _stopped


def _stop(number: int, frame: FrameType | None) -> None:
    global _stopped
    _stopped = True
    if _in_callback(frame):
        again = threading.Timer(_AGAIN, _thread.interrupt_main)
        again.daemon = True
        again.start()
        return
    signal.default_int_handler(number, frame)


def _in_callback(frame: FrameType | None) -> bool:
    """Return whether one of Blender's operators has called Python: it would swallow what is raised there, and go on."""
    inner = frame
    while frame is not None:
        if frame.f_code.co_filename.endswith(_OPERATORS) and frame is not inner:
            return True
        frame = frame.f_back
    return False


def _end_quietly(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """End as `headless.commands.leave` does where the user stops a command that is still loading its parts."""
    if not issubclass(kind, KeyboardInterrupt) and not _stopped:
        sys.__excepthook__(kind, error, trace)
        return
    print("interrupted; nothing was left half-written", file=sys.stderr, flush=True)
    os._exit(130)


_started = Path(sys.argv[0]) if sys.argv else Path()
if _started.name in ("-m", "synthroads") or _started.parent.name == "headless":  # a command, not a library
    sys.excepthook = _end_quietly
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _stop)
