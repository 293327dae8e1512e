"""A scenario with one effect of the sensor off: the same rays and random numbers, so that clouds are pairs.

All random numbers are keyed by what they are for: leaving an effect out changes none of the others'.
"""

from collections.abc import Iterable

from ..base.errors import InputError, nearest_name
from .scenario import Scenario, data_as_given, scenario_changes, with_changes

EFFECTS: dict[str, tuple[str, ...]] = {
    "noise": tuple(
        f"scan.noise.{name}=0"
        for name in (
            "range_bias",
            "range_sigma",
            "angle_sigma_mrad",
            "position_sigma",
            "attitude_sigma_deg",
            "heading_sigma_deg",
        )
    ),
    "range-noise": tuple(
        f"scan.receiver.{name}=0"
        for name in ("faint_range_sigma", "incidence_range_noise", "range_walk", "range_tails", "range_delay")
    ),
    "speckle": ("scan.noise.speckle=0",),
    "dropout": ("scan.noise.dropout=0",),
    "detection": ("scan.receiver.threshold_to_noise=0",),
    "response": (
        "scan.receiver.response=power",
        *(
            f"scan.receiver.{name}=0"
            for name in ("soft_saturation", "gain_sigma_db", "overlap_full", "pedestal", "lost_numbers")
        ),
        "scan.receiver.compression=1",
    ),
    "multipath": ("scan.multipath=0",),
    "mixed-points": ("scan.receiver.echo_separation=resolution",),
    "motion": tuple(f"scan.motion.{name}=0" for name in ("position_sigma", "attitude_sigma_deg", "heading_sigma_deg")),
    "mirror-clock": ("scan.mirror_clock=locked",),
    "strip-errors": tuple(
        f"scan.strip_errors.{name}=0"
        for name in ("boresight_sigma_deg", "lever_arm_sigma", "drift_sigma", "gain_sigma_db", "gain_step_db")
    ),
    "weather": ("scan.weather=null", "scan.attenuation=0"),
    "weather-echoes": ("scan.weather.echoes=false",),
    "relief": ("scan.relief=0",),
    "surface-variation": ("colour.intensity_from_layers=never",),
}
"""Effect -> the changes of a scenario that leave it out. `range-noise` is what exceeds the device's usual precision."""


def scenario_without(scenario: Scenario, effects: Iterable[str]) -> Scenario:
    """Return a scenario without some effects.

    Raises:
        InputError: there is no such effect.

    Example:
        >>> from synthroads_addon import load_scenario
        >>> scenario_without(load_scenario("rq31-600m", ["scan.noise.speckle=0.2"]), ["speckle"]).scan.noise.speckle
        0.0
    """
    changes: list[str] = []
    effects = list(effects)
    # Without weather there is nothing whose echoes could be left out.
    has_weather_echoes = getattr(scenario.scan.weather, "echoes", False) and "weather" not in effects
    for effect in effects:
        if effect not in EFFECTS:
            allowed_text = f"must be one of {', '.join(EFFECTS)}{nearest_name(effect, EFFECTS)}"
            raise InputError("--without", effect, allowed_text)
        if effect != "weather-echoes" or has_weather_echoes:
            changes += EFFECTS[effect]
    return Scenario.from_dict(with_changes(data_as_given(scenario), scenario_changes(changes))) if changes else scenario
