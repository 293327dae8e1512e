"""The name under which SynthRoads signs what it writes."""

from __future__ import annotations

from .. import version


def generator() -> str:
    """Return the program and its version, as in "SynthRoads 1.0.0"."""
    return f"SynthRoads {version()}"
