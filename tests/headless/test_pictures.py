"""Without matplotlib commands leave their pictures out and say so, before they work for minutes."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

import pytest

from headless.cli import main
from headless.pictures import can_draw


def test_a_picture_is_left_out_with_a_word(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(logging.getLogger("synthroads"), "propagate", True)
    caplog.set_level(logging.INFO, "synthroads")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not can_draw("plot.png")
    text = "plot.png is left out: it needs the package matplotlib: pip install 'synthroads[ml]'"
    assert {record.getMessage() for record in caplog.records} == {text}  # a test before may have left a handler


def test_a_picture_is_drawn_where_it_can_be(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    pytest.importorskip("matplotlib")
    assert can_draw("plot.png")
    assert not caplog.records


def test_plots_that_are_asked_for_are_refused_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setattr("headless.tradeoff._measure_row", lambda *_: pytest.fail("it is measured"))
    words = ["tradeoff", "--output", str(tmp_path / "out"), "--pictures", str(tmp_path), "--knobs", "caster"]
    assert main(words) == 2
    assert "--pictures" in (text := capsys.readouterr().err)
    assert "needs the package matplotlib: pip install 'synthroads[ml]'" in text
    assert not (tmp_path / "out").exists()


def test_tradeoff_without_plots_measures_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    row = {"left_out": "not measured here", "errors": {}, "seconds": 0.0}
    monkeypatch.setattr(
        "headless.tradeoff._measure_row", lambda scene, knob, value: {"knob": knob, "value": value, **row}
    )
    words = ["tradeoff", "--output", str(tmp_path / "out"), "--scenario", "rq31-600m", "--knobs", "caster"]
    assert main(words) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"rows", "rq31-600m.json", "rq31-600m.md"}
    assert "the plot is left out: it needs the package matplotlib" in capsys.readouterr().err
