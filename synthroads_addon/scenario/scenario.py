"""`Scenario`: the one description of a job, from the road's limits to the files wanted, and what it requires."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from pydantic import Field, field_validator

from ..base.changes import apply_values, parse_change
from ..base.errors import InputError
from ..base.files import PRESETS, preset_names, preset_path
from ..base.schema import ClosedModel, notes, quantity, read_json
from ..cloud.layers import optional_arrays
from ..materials.table import Material, read_material_table
from ..road.guidelines import SECTIONS_OF_CLASS
from ..scanning.beam import RINGS
from ..scanning.colour.colour import takes_nodes
from ..scanning.devices.device import load_device
from ..twin.formats import FORMATS, IfcSettings, TwinFormat
from ..twin.scene.registry import ENTRIES as SCENE_ENTRIES
from ..twin.scene.registry import SceneFormat
from .cloud import CloudScenario
from .colour import ColourScenario
from .road import RoadScenario
from .scan import Footprints, ScanScenario, scanner_setting
from .sweeps import SweepScenario
from .tolerance import TIMES, Tolerance, with_unit

SCENARIOS = PRESETS / "scenarios"

Output = Literal["parameters", "cloud", "centerline", "scene", "previews"]
OUTPUTS: tuple[Output, ...] = get_args(Output)
OF_POINTS: tuple[Output, ...] = ("cloud", "previews")
"""Outputs that are made of points: all that a scan of a scene by others writes beside ``report.json``."""
LONGEST_WHOLE, SECTION_LENGTH = 5000.0, 500.0
"""A longer road is built and scanned by sections of this length unless the scenario says otherwise, m."""
_CLASS_AND_SECTION = ("design_class", "cross_section")
_KINDS = (("platform", "kind", ("roll_deg", "pitch_deg", "yaw_deg")), ("weather", "condition", ()))
"""Parts of a scan of one kind or another, the field that says which, and fields that stay with another kind."""
_DEVICE_SETTINGS = ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")


class Scenario(ClosedModel):
    """One job: a road, a scan, the files wanted, and how faithful they are to be."""

    type: Literal["Scenario"] = "Scenario"
    version: Literal["1.0"] = "1.0"
    title: str = Field("", description="Title for people.")
    seed: int = quantity(1, "1", "Seed of all random choices.", (0, 2**63 - 1))
    fidelity: Literal["draft", "standard", "high"] = Field(
        "standard", description="Speed against accuracy, as a preset."
    )
    geometric_tolerance: float | None = quantity(
        None,
        "m",
        "Chord error of the model; the fidelity's if not given.",
        (1e-4, 1),
        title="Model's Tolerance",
        inherits="fidelity.tolerance",
    )
    vegetation_detail: float | None = quantity(
        None,
        "1",
        "Share of the vegetation built; the fidelity's if not given.",
        (0, 1),
        title="Plants Built",
        inherits="fidelity.vegetation_detail",
    )
    tolerance: Tolerance | None = Field(
        None, description="Largest errors; the fastest settings that keep them are chosen, except those given here."
    )
    time_budget: float | None = quantity(
        None, "s", "Time for the whole job; the best settings that fit it are chosen.", gt=0, le=1e7
    )
    materials_table: str | None = Field(
        None,
        title="Table of Your Own",
        description="JSON file, or shipped table, of materials that replace the usual ones of the same names.",
        json_schema_extra=notes(unset="The shipped ones"),
    )
    road: RoadScenario = Field(RoadScenario(), description="The road's limits.")
    scan: ScanScenario = Field(ScanScenario(), description="The scan.")
    colour: ColourScenario = Field(ColourScenario(), description="Colours and material layers.")
    cloud: CloudScenario = Field(CloudScenario(), description="The cloud's files and what they hold.")
    sweeps: SweepScenario = Field(SweepScenario(), description="Sweeps with boxes, tracks and labels.")
    outputs: tuple[Output, ...] = Field(
        OUTPUTS,
        title="Files",
        description="Files to write; what none of them needs isn't computed.",
        json_schema_extra=notes(
            labels={
                "parameters": "Parameter Set",
                "cloud": "Point Cloud",
                "centerline": "Centreline",
                "scene": "Blender File",
                "previews": "Pictures",
            }
        ),
    )
    scene_formats: tuple[SceneFormat, ...] = Field(
        ("blend",),
        min_length=1,
        title="Scene as",
        description="Formats of the built scene, where files to write have it.",
        json_schema_extra=notes(labels={name: entry.label for name, entry in SCENE_ENTRIES.items()}),
    )
    twin: tuple[TwinFormat, ...] = Field(
        (),
        title="Semantic Model",
        description="Formats of the geometric-semantic model to write.",
        json_schema_extra=notes(labels={name: made.label for name, made in FORMATS.items()}),
    )
    ifc: IfcSettings | None = Field(
        None,
        title="IFC",
        description="How the geometric-semantic model is written as IFC.",
        json_schema_extra=notes(unset="Along the alignment"),
    )

    @field_validator("time_budget", mode="before")
    @classmethod
    def _read_unit(cls, value: Any) -> Any:
        """Return a time with a unit, such as "2 h", in seconds; anything else as it is."""
        if not isinstance(value, str):
            return value
        try:
            return with_unit("time_budget", value, TIMES)
        except InputError as error:
            raise ValueError(error.allowed) from None

    @property
    def chooses(self) -> bool:
        """Return whether settings are to be chosen, by a tolerance or a time, before the work begins."""
        return self.tolerance is not None or self.time_budget is not None

    @property
    def beam_rings(self) -> tuple[int, ...]:
        """Return the number of rays on each ring around the beam's axis: the scenario's, else the fidelity's."""
        rings = self.scan.beam_rings
        return RINGS[self.settings().rays_per_pulse] if rings is None else rings

    @property
    def kept_layers(self) -> frozenset[str]:
        """Return the names of the optional per-point layers that the cloud's files hold; none without a cloud."""
        return self.cloud.arrays() & optional_arrays() if "cloud" in self.outputs else frozenset()

    @property
    def coloured_layers(self) -> frozenset[str]:
        """Return the names of the layers that points get besides what is measured: ``rgb`` and material layers."""
        rgb = {"rgb"} if self.colour.rgb else set()
        return frozenset(rgb | (self.kept_layers & optional_arrays("material")))

    @property
    def scans(self) -> bool:
        """Return whether anything is scanned or photographed: points are wanted, or there are cameras."""
        return bool(set(self.outputs) & set(OF_POINTS)) or self.scan.cameras is not None

    @property
    def may_render(self) -> bool:
        """Return whether a scan may have to render: whether it does depends on the scene's materials as well."""
        colour = self.colour
        by_layers = {"always": True, "never": False, "auto": takes_nodes(colour.settings(self.fidelity))}
        needs_materials = bool(self.coloured_layers) or by_layers[colour.intensity_from_layers]
        needs_materials |= self.scan.cameras is not None
        return self.scans and needs_materials and self.colour.source != "material"

    def own_materials(self) -> dict[str, Material]:
        """Return the materials of the scenario's own table by name; none if it has none.

        Raises:
            InputError: the file isn't there or no material table.
        """
        return read_material_table(self.materials_table) if self.materials_table else {}

    def section_length(self, length: float) -> float | None:
        """Return the length (m) of the sections by which a road of a length (m) is scanned; None if whole."""
        if not self.scans:
            return None
        own_length = self.scan.section_length
        section_length, longest_whole = (
            (SECTION_LENGTH, LONGEST_WHOLE) if own_length is None else (own_length, 2.0 * own_length)
        )
        return section_length if length > longest_whole else None

    def check_sections(self, length: float) -> None:
        """Raise an InputError if a road of a length (m) is scanned by sections and the job needs all of its model."""
        section_length = self.section_length(length)
        if section_length is None:
            return
        if self.chooses:
            name = "time_budget" if self.tolerance is None else "tolerance"
            text = f"can't be kept on a road of {length:g} m, which is built by sections of {section_length:g} m: "
            raise InputError(name, getattr(self, name), f"{text}choose on a shorter road, and use its settings")
        if "scene" in self.outputs:
            text = f"can't have scene: a road of {length:g} m is built by sections of {section_length:g} m; "
            text += f"leave scene out, or set scan.section_length to {length / 2.0:g} or more"
            raise InputError("outputs", list(self.outputs), text)

    def settings(self) -> Settings:
        """Return the settings that the fidelity stands for, with the scenario's own values in their place."""
        values: dict[str, Any] = {
            "tolerance": self.geometric_tolerance,
            "vegetation_detail": self.vegetation_detail,
            "rays_per_pulse": self.scan.rays_per_pulse,
            "relief_octaves": self.scan.relief_octaves,
            "footprints": self.scan.footprints,
        }
        own_values = {name: value for name, value in values.items() if value is not None}
        return replace(FIDELITIES[self.fidelity], **own_values)


@dataclass(frozen=True)
class Settings:
    """Settings of a job that trade speed for accuracy.

    Attributes:
        tolerance: largest chord error of the model's road surface, m.
        vegetation_detail: share of the plants that are built, 0 to 1.
        rays_per_pulse: rays that sample a pulse's footprint.
        relief_octaves: octaves of the surfaces' micro-relief.
        footprints: whether all rays of each footprint are cast, or only where more than one plane can be met.
    """

    tolerance: float
    vegetation_detail: float
    rays_per_pulse: int
    relief_octaves: int = 4
    footprints: Footprints = "full"


FIDELITIES = {
    "draft": Settings(tolerance=0.020, vegetation_detail=0.3, rays_per_pulse=1, relief_octaves=2),
    "standard": Settings(tolerance=0.005, vegetation_detail=1.0, rays_per_pulse=7, relief_octaves=4),
    "high": Settings(tolerance=0.001, vegetation_detail=1.0, rays_per_pulse=19, relief_octaves=6),
}


def scenario_names() -> list[str]:
    """Return the names of the built-in scenarios, sorted."""
    return preset_names(SCENARIOS)


def load_scenario(name_or_file: str, changes: list[str] | None = None) -> Scenario:
    """Return a built-in scenario, or one from a file, with ``path=value`` changes applied.

    Raises:
        InputError: there is no such scenario, or a field is unknown or out of its limits.

    Example:
        >>> scenario = load_scenario("rq31-600m", ["seed=7", "road.length=200"])
        >>> scenario.road.length, scenario.road.cross_section
        (200.0, 'RQ31')
    """
    path = preset_path(SCENARIOS, name_or_file, "--scenario")
    scenario = Scenario.from_dict(read_json(path), source=str(name_or_file))
    if not changes:
        return scenario
    return Scenario.from_dict(with_changes(data_as_given(scenario), scenario_changes(changes)))


def data_as_given(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario's JSON data, without a coordinate system that nobody named: an axis brings its own."""
    data = scenario.to_dict()
    if "epsg" not in scenario.road.model_fields_set:
        data["road"] = {name: value for name, value in data["road"].items() if name != "epsg"}
    return data


def scenario_changes(changes: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Yield path and value of each ``path=value`` of a scenario, see `parse_change`."""
    return (parse_change(change, Scenario) for change in changes)


def with_changes(data: Any, changes: Iterable[tuple[str, Any]]) -> Any:
    """Return a scenario's JSON data with values set by their dotted paths, and what doesn't fit them left out.

    What the scenario said itself and doesn't fit them any more gives way, see `drop_misfits`.
    """
    data_before, changed_paths = data, set()
    for path, value in changes:
        data = apply_values(data, {path: value})
        changed_paths.add(path)
    return drop_misfits(data, data_before, changed_paths)


def drop_misfits(
    data: dict[str, Any], data_before: Mapping[str, Any], changed_paths: AbstractSet[str]
) -> dict[str, Any]:
    """Return a changed scenario's JSON data without its former settings that don't fit the changes any more.

    Of a design class and a standard cross-section that don't fit each other, the one that no change names is left out;
    and of a device that a change names, the settings that it can't do and no change names. What the changes name stays,
    and is refused later where it contradicts itself. A platform or weather of another kind than before begins anew: it
    only keeps the scanner's mounting.

    Args:
        data: after the changes.
        data_before: without them.
        changed_paths: paths of the changed fields, e.g. ``road.design_class``.
    """
    road = data.get("road")
    if isinstance(road, dict):
        data = data | {"road": _without(road, _misfit_of_road(road, changed_paths))}
    for (
        part,
        tag,
        kept_fields,
    ) in _KINDS:  # first: a scan with fields of another platform can't tell what its device can't do
        data = _reset_part(data, data_before, changed_paths, part, tag, kept_fields)
    scan = data.get("scan")
    if isinstance(scan, dict) and "scan.device" in changed_paths:
        data = data | {"scan": _without(scan, *_misfits_of_device(scan, changed_paths))}
    return data


def _reset_part(
    data: dict[str, Any],
    data_before: Mapping[str, Any],
    changed_paths: AbstractSet[str],
    part: str,
    tag: str,
    kept_fields: Sequence[str],
) -> dict[str, Any]:
    """Return data in which a platform or weather of another kind than before keeps what may stay or was changed."""
    scan = data.get("scan")
    part_data = scan.get(part) if isinstance(scan, dict) else None
    path = f"scan.{part}"
    if (
        not isinstance(part_data, dict)
        or f"{path}.{tag}" not in changed_paths
        or part_data.get(tag) == _kind(data_before, part, tag)
    ):
        return data
    new_part_data = {
        name: value for name, value in part_data.items() if f"{path}.{name}" in changed_paths or name in kept_fields
    }
    return data | {"scan": data["scan"] | {part: new_part_data}}


def _kind(data: Mapping[str, Any], part: str, tag: str) -> Any:
    """Return the kind of a scenario's platform or weather, by its data; None if there is none."""
    parts = (data.get("scan") or {}).get(part) or {}
    return parts.get(tag) if isinstance(parts, dict) else None


def _misfit_of_road(road: dict[str, Any], changed_paths: AbstractSet[str]) -> str | None:
    """Return "design_class" or "cross_section", whichever gives way to the other; None if neither does."""
    unchanged_names = [
        name for name in _CLASS_AND_SECTION if not any(path.startswith(f"road.{name}") for path in changed_paths)
    ]
    section = road.get("cross_section")
    if len(unchanged_names) != 1 or not isinstance(section, str):
        return None
    return None if section in SECTIONS_OF_CLASS.get(str(road.get("design_class")), ()) else unchanged_names[0]


def _misfits_of_device(scan: dict[str, Any], changed_paths: AbstractSet[str]) -> list[str]:
    """Return the names of a scan's settings that its device can't do and that no change names."""
    misfits: list[str] = []
    try:
        device = load_device(ScanScenario.from_dict(scan).device)
    except InputError:
        return misfits
    while True:
        try:
            scanner_setting(ScanScenario.from_dict(_without(scan, *misfits)), device)
        except InputError as error:
            name = error.field.removeprefix("scan.")
            if name in _DEVICE_SETTINGS and name not in misfits and error.field not in changed_paths and name in scan:
                misfits.append(name)
                continue
        return misfits


def _without(data: dict[str, Any], *names: str | None) -> dict[str, Any]:
    """Return data without the fields of some names."""
    return {name: value for name, value in data.items() if name not in names}
