"""Which choices of settings, by a tolerance or a time, a scenario can ask for."""

from ..base.errors import InputError
from ..scanning.colour.colour import MATERIAL_LAYERS
from .scenario import OF_POINTS, Scenario


def has_kind(scenario: Scenario, kind: str) -> bool:
    """Return whether a job's points have what an error is of: colours ("colour") or material layers ("layers")."""
    coloured_layers = scenario.coloured_layers
    return "rgb" in coloured_layers if kind == "colour" else bool(set(MATERIAL_LAYERS) & coloured_layers)


def check_choice(scenario: Scenario, is_foreign: bool = False) -> None:
    """Raise InputError if a scenario asks for a choice of settings that can't be made or promised.

    Args:
        scenario: the job; nothing is refused if it leaves no choice.
        is_foreign: the scene isn't built, so that nothing is known of its height's errors.

    Raises:
        InputError: names the field.
    """
    if not scenario.chooses:
        return
    limits = scenario.tolerance.limits() if scenario.tolerance else {}
    if scenario.tolerance is not None and not limits:
        raise InputError("tolerance", None, "must limit at least one kind of error")
    colour, no_light_paths = scenario.colour, "can't be promised for whole light paths: colour.lighting must be direct"
    no_layer_intensities = (
        "can't be promised for intensities from the points' layers: remove colour.intensity_from_layers"
    )
    no_relief_factor = "can't be promised for a relief of another strength than the surfaces': scan.relief must be 1"
    no_such_error = "there is no such error, as points get no"
    refusals = (
        ("intensity", colour.intensity_from_layers == "always", no_layer_intensities),
        ("relief", scenario.scan.relief != 1.0, no_relief_factor),
        ("colour", colour.lighting == "path", no_light_paths),
        ("layers", colour.lighting == "path", no_light_paths),
        ("height", is_foreign, "can't be promised for a scene that was built elsewhere"),
        ("colour", not has_kind(scenario, "colour"), f"{no_such_error} colours: colour.rgb is false"),
        ("layers", not has_kind(scenario, "layers"), f"{no_such_error} layers: cloud.attributes names none of them"),
    )
    for kind, is_refused, text in refusals:
        if is_refused and kind in limits:
            raise InputError(f"tolerance.{kind}", limits[kind], text)
    if not set(scenario.outputs) & set(OF_POINTS):
        raise InputError(
            "outputs", list(scenario.outputs), "must contain the cloud or previews so that settings can be chosen"
        )
