"""Thin command lines over `synthroads_addon`; each module is one sub-command."""

import os
import sys
from pathlib import Path
from types import TracebackType


def _end_quietly(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """End as `headless.cli.leave` does where the user stops a command that is still loading its parts."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    print("interrupted; nothing was left half-written", file=sys.stderr, flush=True)
    os._exit(130)


_started = Path(sys.argv[0]) if sys.argv else Path()
if _started.name in ("-m", "synthroads") or _started.parent.name in ("headless", "ml"):  # a command, not a library
    sys.excepthook = _end_quietly
