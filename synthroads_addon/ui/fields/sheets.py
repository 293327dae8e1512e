"""Which field of the scenario stands in which panel.

Every field has one place. ``road.turnouts.*`` stands for all fields of that part that have no place elsewhere, so that
a new field of the schema appears by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from .fields import Field
from .properties import PATHS


@dataclass(frozen=True)
class Sheet:
    """A panel's title, its place among the others, and what it shows.

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
        """Return the name of the panel's class."""
        return f"SYNTHROADS_PT_{self.name}"


SHEETS = (
    Sheet("main", "SynthRoads", "", 0, "fidelity", closed=False),
    Sheet("road", "Road", "main", 10, "road.cross_section road.length seed", closed=False),
    Sheet(
        "section",
        "Alignment and Section",
        "road",
        1,
        "road.design_class road.lanes road.lane_width road.median_width road.radius road.grade_percent "
        "road.lane_changes.* geometric_tolerance road.*",
    ),
    Sheet("turnouts", "Turnouts", "road", 2, "road.turnouts.*"),
    Sheet("pavement", "Pavement", "road", 3, "road.pavement.*"),
    Sheet("markings", "Markings", "road", 4, "road.markings.*"),
    Sheet("materials", "Materials", "road", 5, "road.materials.* materials_table"),
    Sheet("map", "Map", "road", 6, "title road.epsg road.map_origin"),
    Sheet(
        "objects",
        "Objects",
        "main",
        20,
        "road.placement road.vehicles.per_km road.trees_per_hectare road.shrubs_per_hectare road.grass_density",
    ),
    Sheet("barriers", "Barriers", "objects", 1, "road.barriers.*"),
    Sheet("furniture", "Furniture", "objects", 2, "road.furniture.*"),
    Sheet("vehicles", "Vehicles", "objects", 3, "road.vehicles.* scan.traffic_speed_factor"),
    Sheet("vegetation", "Vegetation", "objects", 4, "vegetation_detail road.vegetation.*"),
    Sheet("assets", "Assets of Your Own", "objects", 5, "road.assets"),
    Sheet("environment", "Environment", "main", 30),
    Sheet("weather", "Sun and Weather", "environment", 1, "road.environment.*", closed=False),
    Sheet(
        "terrain",
        "Terrain",
        "environment",
        2,
        "road.embankment_height road.batter_slope road.undulation road.wavelength road.half_width road.elevation_model",
    ),
    Sheet(
        "scanner",
        "Scanner",
        "main",
        40,
        "scan.device scan.platform.kind scan.platform.file scan.platform.height scan.platform.speed",
        closed=False,
    ),
    Sheet(
        "device",
        "Pulses and Lines",
        "scanner",
        1,
        "scan.pulse_rate_khz scan.field_of_view_deg scan.lines_per_second scan.angle_step_deg",
    ),
    Sheet(
        "platform",
        "Platform and Path",
        "scanner",
        2,
        "scan.platform.* scan.platform.roll_deg scan.platform.pitch_deg scan.platform.yaw_deg",
    ),
    Sheet("beam", "Beam", "scanner", 3, "scan.rays_per_pulse scan.beam_rings scan.beam scan.*"),
    Sheet("air", "Air", "scanner", 4, "scan.weather scan.attenuation"),
    Sheet("noise", "Noise", "scanner", 5, "scan.noise.*"),
    Sheet("motion", "Motion", "scanner", 5, "scan.motion.*"),
    Sheet("performance", "Performance", "scanner", 6, "scan.caster scan.threads"),
    Sheet("colour", "Colour", "main", 50, "colour.source colour.rgb colour.mode"),
    Sheet("images", "Rendering", "colour", 1, "colour.*"),
    Sheet("output", "Output", "main", 60, "outputs cloud.formats twin ifc"),
    Sheet("attributes", "Point Attributes", "output", 1, "cloud.*"),
)
"""All panels made of the scenario's fields."""


@cache
def fields_of(sheet: Sheet) -> tuple[Field, ...]:
    """Return the fields that a panel shows, in their order."""
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


@cache
def _place_of(path: str) -> str:
    """Return the row that a field has its place in: its own, or that of the innermost part."""
    rows = {row for sheet in SHEETS for row in sheet.rows.split()}
    if path in rows:
        return path
    parts = path.split(".")[:-1]
    places = (".".join([*parts[:depth], "*"]) for depth in range(len(parts), -1, -1))
    return next((place for place in places if place in rows), "")
