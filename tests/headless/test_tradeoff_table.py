"""The trade-off's knobs and tables; stretches of a path."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless import commands
from headless.tradeoff_table import TABLES, better_row, markdown, time_noise
from synthroads_addon.jobs.measure.tradeoff import KNOBS, knob_rows, row_scenario
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.platforms.stretches import spread_stretches
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import Standing


def _row(knob: str, value: Any, **more: Any) -> dict[str, Any]:
    numbers = {"seconds": 12.34, "model_seconds": 1.0, "image_seconds": 2.0, "peak_memory_mb": None}
    numbers |= {"triangles": 1234567, "rays_per_second": 7, "images": 3, "megapixels": 1.5, "shares": {}, "errors": {}}
    return {"knob": knob, "value": value, **numbers, **more}


def test_every_row_is_named_and_in_a_table() -> None:
    assert len(list(knob_rows(KNOBS))) == sum(len(knob.rows) for knob in KNOBS.values())
    assert len(list(knob_rows(KNOBS))) == 58
    assert {knob.table for knob in KNOBS.values()} == TABLES.keys()


def test_tables_have_the_columns_that_are_measured() -> None:
    found = [
        _row("caster", "embree", errors={"height_mm": 2.5}),
        _row("colour_source", "images", shares={"image": 0.95, "material": 0.004}, errors={"colour_95": 6.0}),
        _row("colour_source", "material", shares={"material": 1.0}, colour_truth="a pixel per return"),
        {"knob": "colour_source", "value": "returns", "left_out": "needs a newer one"},
    ]
    text = markdown(found, "rq31-600m-even")
    assert "| caster | embree | 12.3 | 1.0 | - | 1,234,567 | 7 | 2.5 |" in text
    assert "image (%) | material (%) | colour, CIEDE2000 95 % |" in text
    assert "| 95.00 | 0.40 | 6 |" in text
    assert "| 0.00 | 100.00 | - |" in text
    assert "- colour_source returns: needs a newer one" in text
    assert text.endswith("True colours are those of a pixel per return.\n")
    assert "Light" not in text


def _preset(value: str, seconds: float, *errors: float, knob: str = "fidelity") -> dict[str, Any]:
    names = ("height_mm", "density_percent")
    return _row(knob, value, seconds=seconds, errors=dict(zip(names, errors, strict=False)))


def test_a_preset_is_on_the_front_unless_another_row_is_faster_and_as_accurate() -> None:
    standard = _preset("standard", 100.0, 3.0, -0.2)
    near, fast = _preset("a", 95.0, 3.0, 0.1), _preset("b", 70.0, 2.0, 0.2)
    worse, other_kind = _preset("c", 10.0, 3.2, 0.0), _preset("d", 10.0, 1.0, 0.3)
    alike = _preset("e", 10.0, 3.1, 0.2)
    assert better_row(standard, [worse, other_kind], 0.0) is None
    assert better_row(standard, [near, worse], 0.1) is None
    assert better_row(standard, [near, worse], 0.0) is near
    assert better_row(standard, [near, fast, worse], 0.1) is fast
    assert better_row(standard, [near, fast, alike], 0.1) is alike, "3 % more counts as equal"


def test_the_front_is_in_the_table_with_the_noise_of_time() -> None:
    between = "standard, geometric_tolerance=0.001"
    found = [
        _row("geometric_tolerance", 0.005, seconds=90.0),
        _preset("draft", 50.0, 10.0) | {"all_seconds": [52.0, 50.0]},
        _preset("standard", 100.0, 3.0) | {"all_seconds": [100.0, 122.2]},
        _preset(between, 75.0, 1.0, knob="between"),
        _preset("standard, rays_per_pulse=19", 81.0, 2.0, knob="between"),
    ]
    assert time_noise(found[:1]) is None
    assert time_noise(found) == pytest.approx(0.2, abs=1e-3)
    text = markdown(found, "rq31-600m-even")
    assert "| draft | yes | - |" in text
    assert f"| standard | no | {between}: 75.0 s for 100.0 s |" in text
    assert "compared with 3 other rows of the same job. Errors that are larger by less than 5 % count as equal" in text
    assert "Two runs with the same settings differ in time by up to 20 %; only rows that are faster by more" in text
    assert "| standard | yes | - |" in markdown([*found[:3], found[4]], "rq31-600m-even")


def test_images_from_afar_are_coarser() -> None:
    assert row_scenario("rq31-600m-even", "image_spacing", 30).colour.image_spacing == 30.0
    far = row_scenario("airborne-1000m-even", "ground_sampling_distance", 0.12, ["seed=9"])
    assert (far.colour.ground_sampling_distance, far.seed) == (pytest.approx(1.4), 9)
    # What a knob doesn't change is that of the standard fidelity, whichever the scene's own is.
    assert load_scenario("airborne-1000m-even").fidelity == "draft"
    settings = row_scenario("airborne-1000m-even", "rays_per_pulse", 61).settings()
    assert (settings.tolerance, settings.vegetation_detail, settings.rays_per_pulse) == (0.005, 1.0, 61)
    assert row_scenario("airborne-1000m-even", "fidelity", "high").fidelity == "high"
    text = markdown([_row("image_spacing", 30)], "airborne-1000m-even")
    assert text.endswith("here they are 11.7 times as large.\n")


@pytest.mark.parametrize(("count", "duration"), [(1, 5.0), (16, 0.08), (4, 100.0)])
def test_stretches_are_spread_over_each_strip(count: int, duration: float) -> None:
    path = Standing(speed=2.0)
    path.strips = (Strip(0, 0.0, 75.0), Strip(1, 80.0, 50.0))
    part = spread_stretches(path, count, duration)
    short = count * duration > 75.0
    assert len(part.strips) == (2 if short else 2 * count)
    assert part.share == pytest.approx(1.0 if short else 2 * count * duration / 125.0)
    for strip in part.strips:
        whole = path.strips[strip.index]
        assert whole.start_time <= strip.start_time
        assert strip.start_time + strip.duration <= whole.start_time + whole.duration + 1e-9
    time = part.strips[-1].start_time + np.arange(3.0)
    for mine, all_of_it in zip(part.pose(part.strips[-1], time), path.pose(path.strips[1], time), strict=True):
        np.testing.assert_array_equal(mine, all_of_it)


def _kept(**more: Any) -> dict[str, Any]:
    return _row("caster", "embree", errors={"height_mm": 2.5}, all_seconds=[12.0, 12.34], machine="m") | more


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (None, "row: must be an object with the knob caster and the value embree"),
        (3, "row: must be an object"),
        ([], "row: must be an object"),
        ({}, "row: must be an object"),
        (_kept(value="bvhtree"), "row: must be an object"),
        ({name: value for name, value in _kept().items() if name != "seconds"}, "seconds must be a number from 0"),
        (_kept(seconds="12"), "seconds must be a number from 0"),
        (_kept(seconds=None), "seconds must be a number from 0"),
        (_kept(model_seconds=[]), "model_seconds must be a number from 0"),
        (_kept(triangles=1.5), "triangles must be a whole number from 0"),
        (_kept(triangles=7.0), "triangles must be a whole number from 0"),
        (_kept(triangles=-1), "triangles must be a whole number from 0"),
        (_kept(errors=[]), "errors must be numbers by name"),
        (_kept(errors={"height_mm": None}), "errors must be numbers by name"),
        (_kept(errors={"weight": 1.0}), "errors must be numbers by name"),
        (_kept(shares={"image": "all"}), "shares must be numbers by name"),
        (_kept(all_seconds=3.0), "all_seconds must be a list of numbers above 0"),
        (_kept(all_seconds=[0.0, 0.0]), "all_seconds must be a list of numbers above 0"),
        (_kept(machine=["m"]), "machine must be a text"),
    ],
)
def test_a_damaged_row_is_one_line(
    tmp_path: Path, row: Any, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def measured(scene: str, knob: str, value: Any) -> dict[str, Any]:
        return _row(knob, value, errors={"height_mm": 2.5})

    monkeypatch.setattr("headless.tradeoff._measured_once", measured)
    words = ["--scenario", "rq31-600m-even", "--output", str(tmp_path), "--knobs", "caster", "--resume", "--quiet"]
    assert commands.command("tradeoff", words) == 0
    file = tmp_path / "rows" / "rq31-600m-even" / "caster-embree.json"
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | {"row": _kept()}))
    assert commands.command("tradeoff", words) == 0, "a sound one is kept"
    assert json.loads((tmp_path / "rq31-600m-even.json").read_text())["rows"][-1] == _kept()
    capsys.readouterr()
    file.write_text(json.dumps(data | {"row": row}))
    assert commands.command("tradeoff", words) == 2
    line, *others = capsys.readouterr().err.splitlines()
    assert not others
    assert said in line
    assert str(file) in line
    file.write_text(json.dumps([row]))
    assert commands.command("tradeoff", words) == 2
    assert "must be an object with the knob caster" in capsys.readouterr().err


def test_a_row_that_lacks_an_error_is_not_as_accurate() -> None:
    whole, part = _preset("a", 100.0, 3.0, 0.2), _preset("b", 10.0, 3.0)
    assert better_row(whole, [part], 0.0) is None
    assert better_row(part, [whole], 0.0) is None
