"""The settings that a choice can take for a scenario's knobs: what the scenario gives itself stays as it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...base.errors import InputError
from ...scanning.beam import RINGS
from ...scanning.colour.colour import MATERIAL_LAYERS
from ...scenario.colour import COLOUR_FIDELITIES, image_scale
from ...scenario.scenario import FIDELITIES, Scenario, apply_values
from ..job_files import OF_POINTS
from ..scan.plan import coloured_layers

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


@dataclass(frozen=True)
class ModelKnobs:
    """The model's knobs: see `scenario.Settings`."""

    tolerance: float
    detail: float

    @property
    def changes(self) -> dict[str, Any]:
        """Return the changes of the scenario."""
        return {"geometric_tolerance": self.tolerance, "vegetation_detail": self.detail}

    @property
    def height_error(self) -> float:
        """Return the largest error of the road's height: the model's vertices lie on the surface."""
        return self.tolerance

    @property
    def position_error(self) -> float:
        """Return what the model adds to the error of a hit's position."""
        return self.tolerance / 2.0


def model_knobs(scenario: Scenario, limits: Mapping[str, float]) -> tuple[ModelKnobs, ...]:
    """Return the models to choose from, the cheapest first: with few plants and with all.

    Their geometric tolerance is the coarsest that the limits allow; without limits, a coarse one and a fine one.
    """
    details: tuple[float, ...] = (_COARSEST.vegetation_detail, _FINEST.vegetation_detail)
    if scenario.vegetation_detail is not None:
        details = (scenario.vegetation_detail,)
    if scenario.geometric_tolerance is not None:
        tolerances: tuple[float, ...] = (scenario.geometric_tolerance,) * len(details)
    elif limits:
        allowed = min(limits.get("height", 1.0), _OF_POSITION * limits.get("position", 1.0), _COARSEST.tolerance)
        tolerances = (max(allowed, _LEAST_TOLERANCE),) * len(details)
    else:
        tolerances = (_COARSEST.tolerance, _FINEST.tolerance)[-len(details) :]
    return tuple(ModelKnobs(*pair) for pair in zip(tolerances, details, strict=True))


def rays_choices(scenario: Scenario) -> dict[int, tuple[int, ...]]:
    """Return rays per pulse -> rays on each ring, to choose from; one if the scenario gives it."""
    if scenario.scan.beam_rings is not None:
        return {1 + sum(scenario.scan.beam_rings): scenario.scan.beam_rings}
    if scenario.scan.rays_per_pulse is not None:
        return {scenario.scan.rays_per_pulse: RINGS[scenario.scan.rays_per_pulse]}
    return dict(RINGS)


def rays_changes(scenario: Scenario, rays: int) -> dict[str, Any]:
    """Return the changes for so many rays per pulse."""
    return {} if scenario.scan.beam_rings is not None else {"scan.rays_per_pulse": rays}


def octave_choices(scenario: Scenario) -> tuple[int, ...]:
    """Return octaves of the micro-relief to choose from; none if there is no relief."""
    if scenario.scan.relief == 0.0:
        return ()
    if scenario.scan.relief_octaves is not None:
        return (scenario.scan.relief_octaves,)
    return tuple(preset.relief_octaves for preset in FIDELITIES.values())


def colour_choices(scenario: Scenario, typical_range: float, returns: bool) -> dict[str, dict[str, Any]]:
    """Return what colours and layers can come from: name -> changes, in the order of their accuracy.

    Args:
        scenario: its colours' own fields stay as they are.
        typical_range: the path's, m.
        returns: whether this Blender has a pixel per return.
    """
    colour, scale = scenario.colour, image_scale(typical_range)
    found: dict[str, dict[str, Any]] = {"material": {"colour.source": "material"}}
    for name, preset in COLOUR_FIDELITIES.items():
        changes = {"colour.source": "images"} | {
            f"colour.{field}": getattr(preset, field) * (1.0 if field == "samples" else scale)
            for field in ("image_spacing", "ground_sampling_distance", "samples")
            if getattr(colour, field) is None and not (field == "samples" and colour.lighting == "direct")
        }
        if changes not in found.values():
            found[name] = changes
    if returns and colour.engine == "cycles" and colour.lighting == "direct":
        found["returns"] = {"colour.source": "returns"}
    if colour.source == "auto":
        return found
    return {name: changes for name, changes in found.items() if changes["colour.source"] == colour.source}


def with_changes(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return the scenario with dotted fields changed, and without a choice still to be made."""
    data = apply_values(scenario.to_dict(), changes)
    return Scenario.from_dict({name: value for name, value in data.items() if name not in ("tolerance", "time_budget")})


def given_knobs(scenario: Scenario) -> dict[str, Any]:
    """Return the knobs that a scenario gives itself, by their paths: a choice leaves these as they are."""
    data, found = scenario.to_dict(), {}
    for path in KNOBS:
        part, _, name = path.rpartition(".")
        value = (data[part] if part else data).get(name)
        if value is not None and (path, value) != ("colour.source", "auto"):
            found[path] = value
    return found


def has_kind(scenario: Scenario, kind: str) -> bool:
    """Return whether points of a job have what a kind of error of colours is of: ``colour`` or ``layers``."""
    wanted = coloured_layers(scenario)
    return "rgb" in wanted if kind == "colour" else bool(set(MATERIAL_LAYERS) & wanted)


def check_choice(scenario: Scenario, foreign: bool = False) -> None:
    """Refuse a choice that can't be made or promised, before any work starts.

    Args:
        scenario: the job; nothing is refused if it leaves no choice.
        foreign: the scene isn't built, so that nothing is known of its height's errors.

    Raises:
        InputError: names the field.
    """
    if not scenario.chooses:
        return
    limits = scenario.tolerance.limits() if scenario.tolerance else {}
    if scenario.tolerance is not None and not limits:
        raise InputError("tolerance", None, "must limit at least one kind of error")
    colour, paths = scenario.colour, "can't be promised for whole light paths: colour.lighting must be direct"
    layers = "can't be promised for intensities from the points' layers: take colour.intensity_from_layers out"
    relief = "can't be promised for a relief of another strength than the surfaces': scan.relief must be 1"
    none = "nothing has such an error, as points get no"
    refusals = (
        ("intensity", colour.intensity_from_layers, layers),
        ("relief", scenario.scan.relief != 1.0, relief),
        ("colour", colour.lighting == "path", paths),
        ("layers", colour.lighting == "path", paths),
        ("height", foreign, "can't be promised of a scene that was built elsewhere"),
        ("colour", not has_kind(scenario, "colour"), f"{none} colours: colour.rgb is false"),
        ("layers", not has_kind(scenario, "layers"), f"{none} layers: cloud.attributes names none of them"),
    )
    for kind, wrong, text in refusals:
        if wrong and kind in limits:
            raise InputError(f"tolerance.{kind}", limits[kind], text)
    if not set(scenario.outputs) & set(OF_POINTS):
        raise InputError("outputs", list(scenario.outputs), "must have the cloud or previews for settings to be chosen")
