"""Device presets and files, and settings that contradict the device or themselves."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.scanning.devices.device import (
    SPEED_OF_LIGHT,
    Device,
    Head,
    PulseMode,
    device_names,
    load_device,
    setting_of,
)
from synthroads_addon.scanning.devices.shots import shots
from synthroads_addon.scanning.patterns.registry import PATTERNS
from synthroads_addon.scanning.patterns.wedge_prism import Wedge
from synthroads_addon.scenario.scan import ScanScenario, scanner_setting
from tests.helpers.page_modules import block_of_page
from tests.helpers.scenes.scanners import custom, device, mode, preset

DOCS = Path(__file__).parents[3] / "docs"


def test_every_pattern_has_a_preset() -> None:
    assert {load_device(name).pattern.type for name in device_names()} == set(PATTERNS)


@pytest.mark.parametrize("name", device_names())
def test_presets_are_plausible(name: str) -> None:
    d = load_device(name)
    assert "ssumed" in d.source or "no real device" in d.source
    assert min(d.divergence_mrad) > 0
    assert max(d.divergence_mrad) < 6
    assert d.minimum_range <= 150
    rates = [m.pulse_rate_khz for m in d.modes]
    ranges = {m.pulse_rate_khz: m.maximum_range for m in d.modes}
    assert [ranges[rate] for rate in sorted(rates)] == sorted(ranges.values(), reverse=True)
    # The range falls with the root of the pulse rate, as the laser's mean power is the same.
    powers = [m.maximum_range**2 * m.pulse_rate_khz for m in d.modes]
    np.testing.assert_allclose(powers, powers[0], rtol=0.02)
    for m in d.modes:
        s = preset(name, pulse_rate_khz=m.pulse_rate_khz)
        # The pulses of a line are fired before the next line begins.
        assert s.pulses_per_line / s.pulse_rate <= 1 / s.lines_per_second * (1 + 1e-9)
        assert s.saturation > s.threshold
        assert s.maximum_range >= m.maximum_range > s.minimum_range


def test_what_follows_from_the_device() -> None:
    s = preset("riegl-minivux-3uav", pulse_rate_khz=200)
    assert s.range_resolution == pytest.approx(0.5996, abs=1e-3)
    assert s.threshold == pytest.approx(0.2 / 113.0**2)
    assert s.saturation == pytest.approx(s.threshold * 10**4.5)
    assert s.maximum_range == pytest.approx(SPEED_OF_LIGHT / 2 / 200e3)
    assert s.range_sigma == 0.01
    assert preset("riegl-minivux-3uav", noise={"range_sigma": 0.5}).range_sigma == 0.5
    assert s.divergence == pytest.approx((1.6e-3, 0.5e-3))
    two = preset("riegl-vq-450")
    assert two.shot_rate == pytest.approx(1.1e6)
    # Without a limit by later pulses the brightest sheeting decides.
    s = custom({"type": "polygon_mirror"}, modes=[mode(1, 60, 10)], lines_per_second=[1, 10])
    assert s.maximum_range == pytest.approx(10 * math.sqrt(1000 / 0.2))
    # A head's beams each wait for their own return.
    endless = load_device("velodyne-vlp-16").model_copy(update={"farthest_range": None})
    assert setting_of(endless, ScanScenario()).maximum_range == pytest.approx(50 * math.sqrt(1000 / 0.2))
    # Its numbers for the range end before.
    assert preset("velodyne-vlp-16").maximum_range == 100.0


@pytest.mark.parametrize("divergence", [[0, 0], [100, 100], [0, 100]])
def test_divergence_from_none_to_wide(divergence: list[float]) -> None:
    s = custom({"type": "rotating_mirror"}, divergence_mrad=divergence)
    assert s.divergence == pytest.approx(tuple(1e-3 * value for value in divergence))
    assert np.isfinite(shots(s, 0, 1000, True).direction).all()


LINE = {"device": "riegl-minivux-3uav"}
REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "unknown device": ({"device": "riegl-minivux"}, "scan.device", "riegl-minivux-3uav"),
    "rate that is no mode": (LINE | {"pulse_rate_khz": 150}, "scan.pulse_rate_khz", "100, 200, 300 kHz"),
    "view too wide for the mode": (
        LINE | {"pulse_rate_khz": 200, "field_of_view_deg": 181},
        "scan.field_of_view_deg",
        "180 deg at 200 kHz",
    ),
    "view of fixed optics": (
        {"device": "livox-mid-70", "field_of_view_deg": 60},
        "scan.field_of_view_deg",
        "always sees 70.4 deg",
    ),
    "too many lines": (LINE | {"lines_per_second": 101}, "scan.lines_per_second", "10 to 100 lines/s"),
    "too few lines": (LINE | {"lines_per_second": 9}, "scan.lines_per_second", "10 to 100 lines/s"),
    "too fine by lines": (
        LINE | {"pulse_rate_khz": 300, "field_of_view_deg": 120, "lines_per_second": 10},
        "scan.lines_per_second",
        "angle step of 0.012 deg at 300 kHz; RIEGL miniVUX-3UAV steps 0.018 deg at the finest",
    ),
    "too fine by angle": (
        LINE | {"pulse_rate_khz": 300, "angle_step_deg": 0.0121},
        "scan.angle_step_deg",
        "0.018 deg at the finest",
    ),
    "angle out of the lines' limits": (
        LINE | {"pulse_rate_khz": 100, "angle_step_deg": 0.5},
        "scan.angle_step_deg",
        "10 to 100 lines/s, that is 0.036 to 0.36 deg at 100 kHz",
    ),
    "angle and lines that contradict": (
        LINE | {"pulse_rate_khz": 100, "angle_step_deg": 0.2, "lines_per_second": 50},
        "scan.angle_step_deg",
        "50 lines/s at 100 kHz give 0.18 deg",
    ),
    "no pulse in the view": (
        LINE | {"pulse_rate_khz": 100, "field_of_view_deg": 0.3},
        "scan.lines_per_second",
        "no pulse in the field of view of 0.3 deg",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_inconsistent_settings_are_refused(case: str) -> None:
    scan, field, allowed = REFUSED[case]
    with pytest.raises(InputError) as caught:
        scanner_setting(ScanScenario.from_dict(scan))
    assert caught.value.field == field
    assert allowed in caught.value.allowed


@pytest.mark.parametrize("name", ["pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg"])
@pytest.mark.parametrize("value", [math.nan, math.inf, 0.0, -1.0])
def test_numbers_that_are_none_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        preset("riegl-minivux-3uav", **{name: value})


def test_angle_step_stands_for_lines_per_second() -> None:
    s = preset("riegl-minivux-3uav", pulse_rate_khz=100, angle_step_deg=0.18)
    assert s.lines_per_second == pytest.approx(50, abs=1e-9)
    assert preset("riegl-minivux-3uav", angle_step_deg=0.18, lines_per_second=50).lines_per_second == 50
    # A rounded angle may miss a limit by that: the slowest scan steps 0.09953 deg.
    assert preset("velodyne-vlp-16", angle_step_deg=0.0995).lines_per_second == 5
    s = preset("generic-polygon", angle_step_deg=0.06)
    assert s.lines_per_second == pytest.approx(0.06 * 100e3 / 60)
    s = preset("velodyne-vlp-16", angle_step_deg=0.2)
    assert s.lines_per_second == pytest.approx(0.2 / 360 * 289352 / 16)


FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "lines in the wrong order": ({"lines_per_second": [100, 10]}, "slowest and fastest"),
    "one rate twice": ({"modes": [mode(100, 60), mode(100, 50)]}, "same pulse_rate_khz twice"),
    "range beyond the next pulse": ({"modes": [mode(1000, 60, 900)]}, "at most 599.6 m, unambiguous with 4 pulses"),
    "range below the minimum": ({"modes": [mode(100, 60, 0.5)]}, "more than the minimum range"),
    "range beyond the farthest": ({"farthest_range": 150.0}, "at most the farthest_range 150"),
    "view beyond the zenith": (
        {"pattern": {"type": "polygon_mirror", "centre_from_nadir_deg": 160}},
        "reaches 190 deg from the nadir",
    ),
    "view wider than the turn": (
        {"pattern": {"type": "rotating_mirror", "turn_per_line_deg": 45}},
        "wider than the 45 deg that the beam turns",
    ),
    "view that isn't the wedge's": (
        {"pattern": {"type": "wedge_prism", "wedges": [{"angle_deg": 20, "refractive_index": 1.5, "turns": 1}]}},
        "isn't that of the wedges, 21.73 deg",
    ),
    "total reflection": (
        {"pattern": {"type": "wedge_prism", "wedges": [{"angle_deg": 45, "refractive_index": 1.5, "turns": 1}]}},
        "reflect the beam",
    ),
    "a wedge at rest": (
        {"pattern": {"type": "wedge_prism", "wedges": [{"angle_deg": 20, "refractive_index": 1.5, "turns": 0}]}},
        "turns must not be 0",
    ),
    "no wedge": ({"pattern": {"type": "wedge_prism", "wedges": []}}, "pattern.wedges"),
    "times of other beams": (
        {"pattern": {"type": "rotating_head", "elevations_deg": [0, 1], "firing_times_us": [0]}},
        "firing_times_us must be 2 times",
    ),
    "azimuths of other beams": (
        {"pattern": {"type": "rotating_head", "elevations_deg": [0, 1], "azimuths_deg": [0, 1, 2]}},
        "azimuths_deg must be 2 angles, one for each beam (not 3)",
    ),
    "firing after the sequence": (
        {"pattern": {"type": "rotating_head", "elevations_deg": [0, 1], "firing_times_us": [0, 20.5]}},
        "fires after its end",
    ),
    "too many beams": (
        {"pattern": {"type": "rotating_head", "elevations_deg": [0] * 200}, "heads": [{}, {}]},
        "256 beams at most",
    ),
    "no head": ({"heads": []}, "heads"),
    "unknown pattern": ({"pattern": {"type": "rotating_miror"}}, "did you mean 'rotating_mirror'"),
    "negative divergence": ({"divergence_mrad": [-1, 0]}, "divergence_mrad.0"),
    "too wide a beam": ({"divergence_mrad": [1, 101]}, "divergence_mrad.1"),
    "NaN": ({"pulse_length_ns": math.nan}, "pulse_length_ns"),
    "NaN in a list": ({"divergence_mrad": [math.nan, 0]}, "divergence_mrad.0"),
    "unknown key": ({"wavelenght_nm": 905}, "did you mean 'wavelength_nm'"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_inconsistent_devices_are_refused(case: str) -> None:
    changes, message = FAULTS[case]
    with pytest.raises(InputError) as caught:
        device(**changes)
    assert message in str(caught.value)


def test_own_device_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "own.json"
    file.write_text(json.dumps(load_device("generic-polygon").to_dict() | {"title": "Mine"}), encoding="utf-8")
    assert preset(str(file)).device.title == "Mine"
    file.write_text('{"type": "Device", "wavelength_nm": NaN}', encoding="utf-8")
    with pytest.raises(InputError, match="NaN"):
        load_device(str(file))
    with pytest.raises(MissingFileError):
        load_device(str(tmp_path / "none.json"))


def test_a_key_too_many_is_told_by_the_name_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    file.write_text(json.dumps(load_device("velodyne-vlp-16").to_dict() | {"reach": 100}), encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.json: unknown key 'reach'"):
        load_device(str(file))


@pytest.mark.parametrize("name", device_names())
def test_presets_are_documented(name: str) -> None:
    """The documentation's table has the preset's own numbers."""
    assert_documented(name, load_device(name), (DOCS / "devices.md").read_text(encoding="utf-8"))


def test_the_device_of_the_page_is_documented_as_it_says() -> None:
    device = Device.from_dict(json.loads(block_of_page("extend/device.md", "json")))
    assert_documented("example-handheld", device, block_of_page("extend/device.md", "text"))
    assert shots(setting_of(device, ScanScenario()), 0, 10).direction.shape == (3, 10)


def assert_documented(name: str, d: Device, text: str) -> None:
    """Check the row and the line of a device."""
    assert f"- `{name}` ({d.title}): {d.source}\n" in text
    row = next(line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    rates = ", ".join(f"{m.pulse_rate_khz:g}" for m in sorted(d.modes, key=lambda m: m.pulse_rate_khz))
    views = list(dict.fromkeys(f"{m.field_of_view_deg:g}" for m in sorted(d.modes, key=lambda m: m.pulse_rate_khz)))
    heads = f", {len(d.heads)} heads" if len(d.heads) > 1 else ""
    beams = f", {d.pattern.beams} beams" if d.pattern.beams > 1 else ""
    slowest, fastest = d.lines_per_second
    reach = sorted(m.maximum_range for m in d.modes)
    assert cells[1:] == [
        d.pattern.type.replace("_", " ") + heads + beams,
        f"{d.wavelength_nm:g}",
        rates,
        ", ".join(views),
        f"{slowest:g}" if slowest == fastest else f"{slowest:g} to {fastest:g}",
        f"{d.finest_angle_deg:g}",
        " x ".join(f"{value:g}" for value in d.divergence_mrad),
        f"{d.maximum_returns}",
        f"{d.minimum_range:g}",
        " to ".join(f"{value:g}" for value in dict.fromkeys([reach[0], reach[-1]])),
    ]


def test_the_documented_device_works() -> None:
    """The example of a device of one's own is complete."""
    text = (DOCS / "devices.md").read_text(encoding="utf-8")
    example = text.split("```json\n")[1].split("```")[0]
    s = setting_of(Device.from_dict(json.loads(example)), ScanScenario())
    assert shots(s, 0, 10).direction.shape == (3, 10)


def test_every_field_is_documented() -> None:

    text = (DOCS / "devices.md").read_text(encoding="utf-8")
    models = (Device, PulseMode, Head, Wedge, *PATTERNS.values())
    names = {name for model in models for name in model.model_fields}
    assert [name for name in sorted(names) if f"`{name}`" not in text and f'"{name}"' not in text] == []
