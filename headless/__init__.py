"""Thin command lines over `synthroads_addon`; each module that `headless.cli` lists is one sub-command."""

import sys
from pathlib import Path

from synthroads_addon.base.process.end_signals import handle_end_signals

_started = Path(sys.argv[0]) if sys.argv else Path()
if _started.name in ("-m", "synthroads") or _started.parent.name == "headless":  # a command, not a library
    handle_end_signals()
