"""Which field of the scenario stands in which panel.

Every field has one place. ``road.turnouts.*`` stands for all fields of that part that have no place elsewhere, so that
a new field of the schema appears by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from ..translations.blender import said
from .fields import Field
from .properties import PATHS
from .wording import title_case

_PATH = re.compile(r"\b(?:road|scan|colour|cloud|sweeps)(?:\.[a-z][a-z_0-9]*)+")
"""A path of the scenario within a sentence."""


@dataclass(frozen=True)
class PanelFields:
    """Description of a panel: its title, its place among the others, and the scenario fields it shows.

    Attributes:
        name: the panel's class is SYNTHROADS_PT_name.
        title: shown in its header.
        parent: name of the panel that it lies in; empty for the one that holds all.
        order: place among the panels beside it.
        rows: paths of fields, or of parts with ``.*``, with blanks between them.
        closed: whether it is closed at first.
    """

    name: str
    title: str
    parent: str
    order: int
    rows: str = ""
    closed: bool = True

    @property
    def panel(self) -> str:
        """Return the name of the panel's Blender class."""
        return f"SYNTHROADS_PT_{self.name}"


SHEETS = (
    PanelFields("main", "SynthRoads", "", 0, "fidelity", closed=False),
    PanelFields("road", "Road", "main", 10, "road.cross_section road.length seed", closed=False),
    PanelFields(
        "section",
        "Axis and Section",
        "road",
        1,
        "road.design_class road.lanes road.lane_width road.median_width road.radius road.grade_percent "
        "road.lane_changes.* road.overtaking.* geometric_tolerance road.*",
    ),
    PanelFields("turnouts", "Turnouts", "road", 2, "road.turnouts.*"),
    PanelFields("villages", "Villages", "road", 3, "road.villages.*"),
    PanelFields("side_roads", "Side Roads", "road", 2, "road.side_roads.*"),
    PanelFields("bridges", "Bridges", "road", 2, "road.bridges.*"),
    PanelFields("tunnels", "Tunnels", "road", 2, "road.tunnels.*"),
    PanelFields("interchange", "Interchange", "road", 2, "road.interchange.*"),
    PanelFields("pavement", "Pavement", "road", 3, "road.pavement.*"),
    PanelFields("markings", "Markings", "road", 4, "road.markings.*"),
    PanelFields("materials", "Materials", "road", 5, "road.materials.* materials_table road.textures"),
    PanelFields("changes", "Changes", "road", 7, "road.changes.*"),
    PanelFields("map", "Map", "road", 6, "title road.epsg road.height_epsg road.map_origin"),
    PanelFields(
        "objects",
        "Objects",
        "main",
        20,
        "road.placement road.vehicles.per_km road.trees_per_hectare road.shrubs_per_hectare road.grass_density",
    ),
    PanelFields("barriers", "Barriers", "objects", 1, "road.barriers.*"),
    PanelFields("furniture", "Furniture", "objects", 2, "road.furniture.*"),
    PanelFields("roadside", "Beside the Road", "objects", 3, "road.roadside.*"),
    PanelFields("vehicles", "Vehicles", "objects", 3, "road.vehicles.* scan.traffic_speed_factor"),
    PanelFields("vegetation", "Vegetation", "objects", 4, "vegetation_detail road.vegetation.*"),
    PanelFields("assets", "Assets of Your Own", "objects", 5, "road.assets"),
    PanelFields("environment", "Environment", "main", 30),
    PanelFields("weather", "Sun and Weather", "environment", 1, "road.environment.*", closed=False),
    PanelFields(
        "terrain",
        "Terrain",
        "environment",
        2,
        "road.embankment_height road.batter_slope road.crest_length road.rounding_length road.swale_width "
        "road.ditch_width road.undulation road.wavelength road.half_width road.elevation_model",
    ),
    PanelFields("landscape", "Landscape", "environment", 3, "road.landscape.*"),
    PanelFields(
        "scanner",
        "Scanner",
        "main",
        40,
        "scan.device scan.platform.kind scan.platform.file scan.platform.height scan.platform.speed",
        closed=False,
    ),
    PanelFields(
        "device",
        "Pulses and Lines",
        "scanner",
        1,
        "scan.pulse_rate_khz scan.field_of_view_deg scan.lines_per_second scan.angle_step_deg",
    ),
    PanelFields(
        "platform",
        "Platform and Path",
        "scanner",
        2,
        "scan.platform.* scan.platform.roll_deg scan.platform.pitch_deg scan.platform.yaw_deg",
    ),
    PanelFields("beam", "Beam", "scanner", 3, "scan.rays_per_pulse scan.beam_rings scan.footprints scan.beam scan.*"),
    PanelFields("air", "Air", "scanner", 4, "scan.weather scan.attenuation"),
    PanelFields("receiver", "Receiver", "scanner", 5, "scan.receiver.*"),
    PanelFields("noise", "Noise", "scanner", 5, "scan.noise.*"),
    PanelFields("motion", "Motion", "scanner", 5, "scan.motion.*"),
    PanelFields("strip_errors", "Strip Errors", "scanner", 5, "scan.strip_errors.*"),
    PanelFields("cameras", "Cameras", "scanner", 5, "scan.cameras"),
    PanelFields("performance", "Performance", "scanner", 6, "scan.caster scan.kernels scan.threads"),
    PanelFields("colour", "Colour", "main", 50, "colour.source colour.rgb colour.mode"),
    PanelFields("images", "Rendering", "colour", 1, "colour.*"),
    PanelFields("output", "Output", "main", 60, "outputs cloud.formats scene_formats twin ifc"),
    PanelFields("attributes", "Point Attributes", "output", 1, "cloud.*"),
    PanelFields("sweeps", "Sweeps and Boxes", "output", 2, "sweeps.*"),
)
"""All panels made of the scenario's fields."""


@cache
def fields_of(sheet: PanelFields) -> tuple[Field, ...]:
    """Return the fields that a sheet's panel shows, in order; cached."""
    return tuple(field for row in sheet.rows.split() for field in _fields(row))


def _fields(row: str) -> Iterator[Field]:
    if not row.endswith("*"):
        if row in PATHS:
            yield PATHS[row]
        return
    part = row.removesuffix("*")
    for path, field in PATHS.items():
        if path.startswith(part) and _place_of(path) == row:
            yield field


_ENDS = {"minimum": "smallest value", "maximum": "largest value"}
"""Ends of an interval as the panel says them, by their fields."""


def with_panel_labels(message: str) -> str:
    """Return a message with the paths of fields replaced by their labels and panels: ``road.lanes`` by Road's Lanes."""
    return _PATH.sub(lambda path: panel_label(path[0]), message)


def panel_label(path: str) -> str:
    """Return what the panel calls a field, with the title of its panel; the path itself for one that it doesn't have.

    A part of a field, such as an interval's end or an entry of a list, is named after the field.
    """
    parts = path.split(".")
    for length in range(len(parts), 1, -1):
        field = PATHS.get(".".join(parts[:length]))
        if field is not None:
            rest = [said(_ENDS.get(part, title_case(part))) for part in parts[length:]]
            title = _title_of(field.path)
            return ", ".join([said(field.label), *rest]) + (f" ({said(title)})" if title else "")
    return path


@cache
def _title_of(path: str) -> str:
    """Return the title of the panel that shows a field; empty if none does."""
    return next((sheet.title for sheet in SHEETS if any(field.path == path for field in fields_of(sheet))), "")


@cache
def _place_of(path: str) -> str:
    """Return the sheet row that shows a field: its own path, or the innermost part with ``.*``; empty if none."""
    rows = {row for sheet in SHEETS for row in sheet.rows.split()}
    if path in rows:
        return path
    parts = path.split(".")[:-1]
    places = (".".join([*parts[:depth], "*"]) for depth in range(len(parts), -1, -1))
    return next((place for place in places if place in rows), "")
