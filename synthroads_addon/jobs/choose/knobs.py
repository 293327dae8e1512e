"""The settings that a choice can take for a scenario's knobs: what the scenario gives itself stays as it is."""

from collections.abc import Mapping
from operator import attrgetter
from typing import Any, NamedTuple

from ...base.changes import apply_values
from ...scanning.beam import RINGS
from ...scenario.colour import COLOUR_FIDELITIES, image_scale
from ...scenario.scenario import FIDELITIES, Scenario

_COARSEST, _FINEST = FIDELITIES["draft"], FIDELITIES["high"]
KNOBS = (
    "geometric_tolerance",
    "vegetation_detail",
    "scan.rays_per_pulse",
    "scan.beam_rings",
    "scan.relief_octaves",
    "colour.source",
    "colour.image_spacing",
    "colour.ground_sampling_distance",
)
"""Fields of the scenario that are chosen."""
_LEAST_TOLERANCE = 1e-4
"""Least geometric tolerance that a scenario can have, m."""
_OF_POSITION = 0.2
"""Share of the tolerance of positions that the model may take of it: its surface is off by half of its tolerance."""


class ModelKnobs(NamedTuple):
    """The two settings of the road's model that are chosen: geometric tolerance (m) and vegetation detail (0 to 1)."""

    tolerance: float
    detail: float

    @property
    def changes(self) -> dict[str, Any]:
        """Return these settings as changes of a scenario: field name -> value."""
        return {"geometric_tolerance": self.tolerance, "vegetation_detail": self.detail}


def model_knobs(scenario: Scenario, limits: Mapping[str, float]) -> tuple[ModelKnobs, ...]:
    """Return the model settings to choose from, the cheapest first: with few plants and with all.

    Their geometric tolerance is the coarsest that the limits allow; without limits, a coarse one and a fine one.
    """
    details: tuple[float, ...] = (_COARSEST.vegetation_detail, _FINEST.vegetation_detail)
    if scenario.vegetation_detail is not None:
        details = (scenario.vegetation_detail,)
    if scenario.geometric_tolerance is not None:
        tolerances: tuple[float, ...] = (scenario.geometric_tolerance,) * len(details)
    elif limits:
        tolerance = min(limits.get("height", 1.0), _OF_POSITION * limits.get("position", 1.0), _COARSEST.tolerance)
        tolerances = (max(tolerance, _LEAST_TOLERANCE),) * len(details)
    else:
        tolerances = (_COARSEST.tolerance, _FINEST.tolerance)[-len(details) :]
    return tuple(ModelKnobs(*pair) for pair in zip(tolerances, details, strict=True))


def rays_choices(scenario: Scenario) -> dict[int, tuple[int, ...]]:
    """Return the beams to choose from, rays per pulse -> rays on each ring; only one if the scenario gives it."""
    if scenario.scan.beam_rings is not None:
        return {1 + sum(scenario.scan.beam_rings): scenario.scan.beam_rings}
    if scenario.scan.rays_per_pulse is not None:
        return {scenario.scan.rays_per_pulse: RINGS[scenario.scan.rays_per_pulse]}
    return dict(RINGS)


def octave_choices(scenario: Scenario) -> tuple[int, ...]:
    """Return the numbers of octaves of the micro-relief to choose from; empty if the scan has no relief."""
    if scenario.scan.relief == 0.0:
        return ()
    if scenario.scan.relief_octaves is not None:
        return (scenario.scan.relief_octaves,)
    return tuple(preset.relief_octaves for preset in FIDELITIES.values())


def colour_choices(scenario: Scenario, typical_range: float, has_return_camera: bool) -> dict[str, dict[str, Any]]:
    """Return the colour sources to choose from, name -> changes of the scenario, from least to most accurate.

    Args:
        scenario: its colours' own fields stay as they are.
        typical_range: the path's, m.
        has_return_camera: whether this Blender has a pixel per return.
    """
    colour, scale = scenario.colour, image_scale(typical_range)
    choices: dict[str, dict[str, Any]] = {"material": {"colour.source": "material"}}
    for name, preset in COLOUR_FIDELITIES.items():
        changes = {"colour.source": "images"} | {
            f"colour.{field}": getattr(preset, field) * (1.0 if field == "samples" else scale)
            for field in ("image_spacing", "ground_sampling_distance", "samples")
            if getattr(colour, field) is None and not (field == "samples" and colour.lighting == "direct")
        }
        if changes not in choices.values():
            choices[name] = changes
    if colour.engine == "cycles" and colour.lighting == "direct":
        choices["nodes"] = {"colour.source": "nodes"}
    if has_return_camera and colour.engine == "cycles" and colour.lighting == "direct":
        choices["returns"] = {"colour.source": "returns"}
    if colour.source == "auto":
        return choices
    return {name: changes for name, changes in choices.items() if changes["colour.source"] == colour.source}


def with_changes(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return the scenario with fields changed by dotted path, and without its tolerance and time budget."""
    return Scenario.from_dict(apply_values(scenario.to_dict(), {**changes, "tolerance": None, "time_budget": None}))


def given_knobs(scenario: Scenario) -> dict[str, Any]:
    """Return the choosable fields that a scenario sets itself, dotted path -> value; a choice leaves these alone."""
    values = {path: attrgetter(path)(scenario) for path in KNOBS}
    return {path: value for path, value in values.items() if value not in (None, "auto")}
