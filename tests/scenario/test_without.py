"""Scenarios with one effect off."""

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from synthroads_addon.scenario.without import EFFECTS, scenario_without

EVERYTHING = Scenario.from_dict(
    {
        "scan": {
            "mirror_clock": "free",
            "relief": 0.5,
            "multipath": 2.0,
            "weather": {"condition": "rain", "rate_mm_h": 5.0, "echoes": True},
            "noise": {
                "range_sigma": 0.02,
                "angle_sigma_mrad": 0.1,
                "position_sigma": 0.1,
                "speckle": 0.2,
                "dropout": 0.1,
            },
            "motion": {"position_sigma": 0.2, "attitude_sigma_deg": 0.1},
            "strip_errors": {"boresight_sigma_deg": 0.01, "drift_sigma": 0.1},
            "receiver": {
                "threshold_to_noise": 5.0,
                "response": "logarithmic",
                "pedestal": 2.0,
                "compression": 0.5,
                "faint_range_sigma": 0.1,
                "echo_separation": "waveform",
            },
        },
        "colour": {"intensity_from_layers": "always"},
    }
)


OFF = {
    "noise": lambda scan: not any((scan.noise.range_sigma, scan.noise.angle_sigma_mrad, scan.noise.position_sigma)),
    "range-noise": lambda scan: not any((scan.receiver.faint_range_sigma, scan.receiver.range_tails)),
    "speckle": lambda scan: scan.noise.speckle == 0,
    "dropout": lambda scan: scan.noise.dropout == 0,
    "detection": lambda scan: scan.receiver.threshold_to_noise == 0,
    "response": lambda scan: (
        (scan.receiver.response, scan.receiver.pedestal, scan.receiver.compression) == ("power", 0, 1)
    ),
    "mixed-points": lambda scan: scan.receiver.echo_separation == "resolution",
    "multipath": lambda scan: scan.multipath == 0,
    "motion": lambda scan: not scan.motion.sigma.any(),
    "mirror-clock": lambda scan: scan.mirror_clock == "locked",
    "strip-errors": lambda scan: not scan.strip_errors.moves_points,
    "weather": lambda scan: scan.weather is None and scan.attenuation == 0,
    "weather-echoes": lambda scan: scan.weather.condition == "rain" and not scan.weather.effects(),
    "relief": lambda scan: scan.relief == 0,
}
"""Effect -> whether a scan is without it; `surface-variation` is one of the colours."""


def leaves(data, path: str = "") -> dict[str, object]:
    """Return the values of JSON data by their paths."""
    if not isinstance(data, dict):
        return {path: data}
    return {key: value for name, inner in data.items() for key, value in leaves(inner, f"{path}.{name}").items()}


@pytest.mark.parametrize("effect", sorted(EFFECTS))
def test_one_effect_is_off_and_all_else_as_it_was(effect: str) -> None:
    before, after = (leaves(s.to_dict()) for s in (EVERYTHING, scenario_without(EVERYTHING, [effect])))
    changed = {f"{path.strip('.')}" for path in before | after if before.get(path) != after.get(path)}
    named = {change.partition("=")[0] for change in EFFECTS[effect]}
    assert changed
    if effect != "surface-variation":
        assert not OFF[effect](EVERYTHING.scan)
        assert OFF[effect](scenario_without(EVERYTHING, [effect]).scan)
    assert all(any(path == name or path.startswith(f"{name}.") for name in named) for path in changed)
    assert scenario_without(scenario_without(EVERYTHING, [effect]), [effect]) == scenario_without(EVERYTHING, [effect])


def test_a_device_s_own_effects_are_off_as_well() -> None:
    effects = ["detection", "response", "range-noise", "mixed-points"]
    receiver = scanner_setting(scenario_without(EVERYTHING, effects).scan).receiver
    assert receiver.noise_sigma(1.0) == 0.0
    assert (receiver.response, receiver.echo_separation) == ("power", "resolution")


def test_what_is_no_effect_is_refused_by_name_and_what_is_off_stays_off() -> None:
    with pytest.raises(InputError, match=r"--without.*mixed-point.*mixed-points"):
        scenario_without(EVERYTHING, ["mixed-point"])
    assert scenario_without(Scenario(), ["weather-echoes"]) == Scenario()


@pytest.mark.parametrize("effects", [["weather", "weather-echoes"], ["weather-echoes", "weather"]])
def test_weather_and_its_echoes_can_be_left_out_together(effects: list[str]) -> None:
    rainy = load_scenario("rq31-600m", ["scan.weather.condition=rain", "scan.weather.echoes=true"])
    assert scenario_without(rainy, effects) == scenario_without(rainy, ["weather"])
