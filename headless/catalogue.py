"""Catalogue of shipped names, with key figures: scenarios, laser scanners, recipes, classes, and others.

Files of one's own are described in the same way.
"""

from collections import Counter

from synthroads_addon.base.catalogue import Entry, Kind, figure_text, figures, preset_file, range_text
from synthroads_addon.base.classes import ClassSelector, Member, class_scheme, scheme_file, scheme_names
from synthroads_addon.base.files import PRESETS, preset_names
from synthroads_addon.dataset.recipe import RECIPES, load_recipe, recipe_names
from synthroads_addon.materials.table import material_table_path, read_material_table
from synthroads_addon.scanning.devices.device import DEVICES, device_names, load_device
from synthroads_addon.scenario.assets import library_file, library_names, read_asset_library
from synthroads_addon.scenario.scenario import SCENARIOS, load_scenario, scenario_names


def _scenario(name: str) -> Entry:
    made = load_scenario(name)
    section = made.road.cross_section
    figures_by_name = {
        "cross_section": section if isinstance(section, str) else "by hand",
        "design_class": made.road.design_class,
        "length": made.road.length,
        "platform": made.scan.platform.kind,
        "device": made.scan.device,
        "fidelity": made.fidelity,
    }
    return Entry(name, made.title, preset_file(SCENARIOS, ".json", name, scenario_names()), figures_by_name)


def _device(name: str) -> Entry:
    made = load_device(name)
    figures_by_name = {
        "pattern": made.pattern.name,
        "heads": len(made.heads),
        "beams": made.channels,
        "wavelength_nm": made.wavelength_nm,
        "pulse_rates_khz": [mode.pulse_rate_khz for mode in made.modes],
        "field_of_view_deg": [mode.field_of_view_deg for mode in made.modes],
        "lines_per_second": list(made.lines_per_second),
        "finest_angle_deg": made.finest_angle_deg,
        "divergence_mrad": list(made.divergence_mrad),
        "maximum_returns": made.maximum_returns,
        "minimum_range": made.minimum_range,
        "maximum_ranges": [mode.maximum_range for mode in made.modes],
    }
    return Entry(name, made.title, preset_file(DEVICES, ".json", name, device_names()), figures_by_name, made.source)


def _recipe(name: str) -> Entry:
    made = load_recipe(name)
    splits = Counter(split for group in made.groups for split in group.splits())
    figures_by_name = {
        "scenes": sum(group.scenes for group in made.groups),
        "splits": dict(splits),
        "scenario": made.scenario,
        "layouts": list(made.layouts),
    }
    file = preset_file(RECIPES, ".yaml", name, recipe_names())
    return Entry(name, made.title, file, figures_by_name, " ".join(made.description.split()))


def _classes(name: str) -> Entry:
    rows = class_scheme(name).rows
    table = [{"id": row.id, "name": row.name, "las": row.las, "of": [_member(one) for one in row.of]} for row in rows]
    return Entry(name, f"{len(rows)} classes", scheme_file(name), {"classes": table})


def _member(member: Member) -> str | int:
    """Return a member of a class as its name or number, and a selector as text `field=value ...`."""
    if not isinstance(member, ClassSelector):
        return member
    shown = {key: value for key, value in member.to_dict().items() if key != "where" and value} | member.where
    return " ".join(f"{key}={value}" for key, value in shown.items())


def _assets(name: str) -> Entry:
    made = {key: asset.class_name for key, asset in read_asset_library(name).assets.items()}
    return Entry(name, f"{len(made)} assets", library_file(name), {"assets": made})


def _materials(name: str) -> Entry:
    made = read_material_table(name)
    figures_by_name = {"materials": {key: round(row.reflectivity, 3) for key, row in made.items()}}
    return Entry(name, f"{len(made)} materials in place of the usual ones", material_table_path(name), figures_by_name)


KINDS = {
    "scenarios": Kind(
        "Scenarios",
        "--scenario NAME",
        scenario_names,
        _scenario,
        (".json",),
        ("what it is", "road", "m", "platform", "device", "fidelity"),
        figures("cross_section", "length", "platform", "device", "fidelity"),
    ),
    "devices": Kind(
        "Laser scanners",
        "--device NAME",
        device_names,
        _device,
        (".json",),
        ("what it is", "nm", "kHz", "view, deg", "lines/s", "returns", "20 % target, m"),
        figures(
            *("wavelength_nm", "pulse_rates_khz", "field_of_view_deg"),
            *("lines_per_second", "maximum_returns", "maximum_ranges"),
            field_of_view_deg=range_text,
            lines_per_second=range_text,
            maximum_ranges=range_text,
        ),
    ),
    "recipes": Kind(
        "Recipes",
        "synthroads dataset NAME",
        recipe_names,
        _recipe,
        (".yaml", ".yml", ".json"),
        ("what it is", "scenes", "splits", "from"),
        figures("scenes", "splits", "scenario"),
    ),
    "classes": Kind(
        "Schemes of classes",
        "--set cloud.classes=NAME",
        scheme_names,
        _classes,
        (".json",),
        ("id", "class", "LAS", "stands for"),
        lambda one: [
            [str(row["id"]), row["name"], str(row["las"]), figure_text(row["of"])] for row in one.figures["classes"]
        ],
    ),
    "assets": Kind(
        "Libraries of assets",
        "--set 'road.assets=[\"NAME\"]'",
        library_names,
        _assets,
        (".json",),
        ("asset", "class"),
        lambda one: list(one.figures["assets"].items()),
    ),
    "material-tables": Kind(
        "Tables of materials",
        "--set materials_table=NAME",
        lambda: preset_names(PRESETS / "material_tables"),
        _materials,
        (".json",),
        ("material", "reflectivity"),
        lambda one: [[name, f"{value:.3f}"] for name, value in one.figures["materials"].items()],
    ),
}
"""Kinds of scenes and scans that can be listed, by name; `ml.catalogue` has the rest."""
