"""How names and units of the schema are written in the panel."""

from __future__ import annotations

from ...cloud.layers import LAYERS
from ...twin.formats import FORMATS

LABELS = {
    "road.lane_changes.share": "Lane Drops and Gains",
    "road.lane_changes.taper_length": "Their Taper",
    "road.cross_section": "Cross-Section",
    "road.lanes": "Lanes Each Way",
    "road.epsg": "EPSG Code",
    "road.map_origin": "Map Origin",
    "road.half_width": "Reach Each Side",
    "road.barriers.median": "In the Median",
    "road.barriers.roadside": "At the Edges",
    "road.barriers.concrete_median": "Of Concrete in the Median",
    "road.barriers.concrete_roadside": "Of Concrete at the Edges",
    "road.barriers.noise_barrier": "Noise Barriers",
    "road.barriers.noise_barrier_height": "Their Height",
    "road.barriers.noise_barrier_length": "Their Length",
    "road.furniture.lighting": "Lighting Poles",
    "road.furniture.lighting_height": "Their Height",
    "road.furniture.lighting_spacing": "Their Spacing",
    "road.furniture.surveillance": "Surveillance Pole",
    "road.furniture.surveillance_height": "Its Height",
    "road.furniture.traffic_lights": "Traffic Lights at an Entry",
    "road.furniture.overpass_clearance": "Its Clearance",
    "road.furniture.overpass_width": "Its Width",
    "road.furniture.construction_length": "Its Length",
    "road.pavement.concrete": "Concrete Pavement",
    "road.pavement.rutted": "Ruts in the Outer Lane",
    "road.environment.wet": "Wet Road",
    "scan.noise.range_sigma": "Range",
    "scan.noise.angle_sigma_mrad": "Angle (mrad)",
    "scan.noise.position_sigma": "Position",
    "scan.noise.attitude_sigma_deg": "Roll, Pitch (°)",
    "scan.noise.heading_sigma_deg": "Heading (°)",
    "scan.noise.correlation_time": "Correlated over",
    "scan.noise.dropout": "Lost Returns",
    "road.vehicles.per_km": "Vehicles (per km)",
    "road.vehicles.trucks": "Share of Trucks",
    "road.embankment_height": "Embankment",
    "road.pavement.potholes_per_km": "Potholes (per km)",
    "road.furniture.cabinets_per_km": "Cabinets (per km)",
    "road.shrubs_per_hectare": "Shrubs (per ha)",
    "road.trees_per_hectare": "Trees (per ha)",
    "road.grass_density": "Grass (per m²)",
    "vegetation_detail": "Plants Built",
    "geometric_tolerance": "Model's Tolerance",
    "scan.platform.kind": "Platform",
    "scan.platform.file": "Trajectory",
    "scan.platform.stations": "Stations (m)",
    "scan.platform.lateral_offsets": "Strips at (m)",
    "scan.platform.turn_seconds": "Time of a Turn",
    "scan.platform.turn_deg": "Angle of a Turn (°)",
    "scan.relief": "Micro-Relief",
    "scan.traffic_speed_factor": "Speed of Traffic",
    "colour.rgb": "Coloured Points",
    "colour.mode": "RGB Shows",
    "cloud.point_spacing": "Thin Out to",
    "outputs": "Files",
    "twin": "Semantic Model",
    "materials_table": "Table of Your Own",
}
"""Paths of the scenario that are written otherwise than by their names: those that are terse by themselves."""

NAMES = {
    "uav": "UAV",
    "airborne": "Aircraft",
    "oren_nayar": "Oren–Nayar",
    "bvhtree": "BVH Tree",
    "eevee": "EEVEE",
    "EKA1A": "EKA 1 A",
    "EKA1B": "EKA 1 B",
    "EKA2": "EKA 2",
    "EKA3": "EKA 3",
    "laz": "LAZ",
    "las": "LAS",
    "ply": "PLY",
    "e57": "E57",
    "npz": "NPZ",
    "rules": "By the Rules",
    "random": "At Random",
    "auto": "Automatic",
    "images": "Images Along the Path",
    "returns": "A Pixel per Return",
    "material": "Material",
    "lit": "Sun and Sky",
    "unlit": "Base Colour",
    "false_colour": "Material Layers",
    "direct": "Direct",
    "path": "Whole Light Paths",
    "scene": "Blender File",
    "parameters": "Parameter Set",
    "cloud": "Point Cloud",
    "centerline": "Centreline",
    "previews": "Pictures",
    "range": "Range",
}
"""Values of choices that are written otherwise than with capitals."""

OWN_NAMES = {
    "colour.source": {"material": "Material's Mean", "returns": "A Pixel per Return"},
    "scan.platform.path": {"direct": "Along the Centreline", "smoothed": "Smoothed", "zigzag": "Zigzag"},
}
"""Values that mean something else in one field than in others."""

UNITS = {
    "deg": "°",
    "1/km": "per km",
    "1/m2": "per m²",
    "1/ha": "per ha",
    "1/100 m": "per 100 m",
    "1/m": "per m",
    "1/s": "per s",
    "m/m": "1 : n",
}
"""Units that are written otherwise than in the schema."""
BLENDERS = {"m": "LENGTH", "m/s": "VELOCITY", "s": "TIME_ABSOLUTE"}
"""Units that Blender itself writes beside the number, in the scene's system of units."""
_SILENT = ("", "1", "px", *BLENDERS)
_ENDINGS = {"deg": "_deg", "mrad": "_mrad", "kHz": "_khz", "%": "_percent", "mm/h": "_mm_h", "1/s": "_per_second"}
_SMALL_WORDS = {"and", "at", "by", "from", "in", "of", "per", "the", "to"}


def written_unit(unit: str) -> str:
    """Return a unit as people write it."""
    return UNITS.get(unit, unit)


def label(path: str, unit: str) -> str:
    """Return what the panel calls a field of the scenario, with its unit unless Blender writes that."""
    if path in LABELS:
        return LABELS[path]
    name = path.rpartition(".")[2].removesuffix(_ENDINGS.get(unit, " "))
    text = title_case(name)
    return text if unit in _SILENT else f"{text} ({written_unit(unit)})"


def value_name(path: str, value: str) -> str:
    """Return what the panel calls a value of a choice."""
    if path == "cloud.attributes":
        return LAYERS[value].label
    if path == "twin":
        return FORMATS[value].label
    return OWN_NAMES.get(path, {}).get(value) or NAMES.get(value) or title_case(value)


def title_case(name: str) -> str:
    """Return a name of the schema with capitals, as Blender writes its labels."""
    words = name.replace("_", " ").split()
    return " ".join(w if i and w in _SMALL_WORDS else w[:1].upper() + w[1:] for i, w in enumerate(words))
