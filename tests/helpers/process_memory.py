"""Memory of the process that runs the tests, as Linux tells it."""

from __future__ import annotations

from pathlib import Path

STATUS = Path("/proc/self/status")
"""File that tells it; not there on other systems."""


def memory_mb(name: str = "VmRSS") -> float:
    """Return one of the process's figures, MB: what is resident (VmRSS), or its peak (VmHWM)."""
    return int(STATUS.read_text().split(f"{name}:")[1].split()[0]) / 1000.0


def reset_peak() -> None:
    """Have the peak counted anew from what is resident now: other tests in this process have had theirs."""
    Path("/proc/self/clear_refs").write_text("5")
