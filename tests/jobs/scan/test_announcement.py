"""Pulses, size and time of a long scan are told before it begins; of a short one if details are asked for."""

from __future__ import annotations

import logging
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from synthroads_addon.base.progress import StageTimer
from synthroads_addon.jobs.scan import sink as module
from synthroads_addon.scanning import forecast
from synthroads_addon.scanning.forecast import ScanForecast


@pytest.mark.parametrize(
    ("seconds", "share", "level"),
    [(31.0, 1.0, "INFO"), (29.0, 1.0, "DEBUG"), (8.0, 0.2, "INFO"), (2.0, 0.01, "DEBUG")],
)
def test_what_takes_more_than_half_a_minute_is_told_before_it_begins(
    seconds: float, share: float, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = ScanForecast(80_000_000, seconds, 3e9, 1e9)
    said: list[str] = []
    plan: Any = SimpleNamespace(forecast=lambda: told, summary=lambda: {"triangles": 1, "vertices": 3})
    scenario = SimpleNamespace(outputs=("cloud",))
    sink: Any = SimpleNamespace(
        open=nullcontext,
        summary=lambda: {"points": 0},
        images=None,
        scenario=scenario,
        begin=lambda plan: None,
        end=lambda: None,
    )

    def log(level: int, form: str, *values: Any) -> None:
        said.append(f"{logging.getLevelName(level)} {form % values}")

    def record(*_: Any) -> dict[str, Any]:
        assert said, "it is told before"
        return {}

    monkeypatch.setattr(module, "record", record)
    monkeypatch.setattr(module, "_logger", SimpleNamespace(log=log))
    monkeypatch.setattr(forecast, "share_of_core", lambda: share)
    module.record_cloud([plan], sink, StageTimer())
    (line,) = said
    assert line.startswith(f"{level} scan: 80,000,000 pulses, so up to about as many points (1.0 GB as LAZ), in about ")
    assert "s (0.4 to 1.5 times that) and 3.0 GB of memory" in line or "min (0.4 to 1.5 times that)" in line
