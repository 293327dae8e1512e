"""Catalogue of shipped names, with key figures: scenarios, laser scanners, recipes, classes, and others.

Files of one's own are described in the same way.
"""

from collections import Counter
from textwrap import wrap

from synthroads_addon.base.catalogue import Entry, Kind, figure_text, figures, preset_file, range_text
from synthroads_addon.base.classes import ClassSelector, Member, class_scheme, scheme_file, scheme_names
from synthroads_addon.base.files import PRESETS, preset_names
from synthroads_addon.dataset.recipe import RECIPES, load_recipe, recipe_names
from synthroads_addon.jobs.format_losses import format_losses, format_names
from synthroads_addon.materials.table import material_table_path, read_material_table
from synthroads_addon.scanning.cameras.rig import RIGS, load_rig, rig_names
from synthroads_addon.scanning.devices.device import DEVICES, device_names, load_device
from synthroads_addon.scenario.assets import library_file, library_names, read_asset_library
from synthroads_addon.scenario.scenario import SCENARIOS, load_scenario, scenario_names

_LINE = 84
"""Longest line of what a format holds or loses, in letters."""


def _scenario(name: str) -> Entry:
    """Return the entry of a scenario in the catalogue."""
    scenario = load_scenario(name)
    section = scenario.road.cross_section
    figures_by_name = {
        "cross_section": section if isinstance(section, str) else "by hand",
        "design_class": scenario.road.design_class,
        "length": scenario.road.length,
        "platform": scenario.scan.platform.kind,
        "device": scenario.scan.device,
        "fidelity": scenario.fidelity,
    }
    return Entry(name, scenario.title, preset_file(SCENARIOS, ".json", name, scenario_names()), figures_by_name)


def _device(name: str) -> Entry:
    """Return the entry of a laser scanner in the catalogue."""
    device = load_device(name)
    figures_by_name = {
        "pattern": device.pattern.name,
        "heads": len(device.heads),
        "beams": device.channels,
        "wavelength_nm": device.wavelength_nm,
        "pulse_rates_khz": [mode.pulse_rate_khz for mode in device.modes],
        "field_of_view_deg": [mode.field_of_view_deg for mode in device.modes],
        "lines_per_second": list(device.lines_per_second),
        "finest_angle_deg": device.finest_angle_deg,
        "divergence_mrad": list(device.divergence_mrad),
        "maximum_returns": device.maximum_returns,
        "minimum_range": device.minimum_range,
        "maximum_ranges": [mode.maximum_range for mode in device.modes],
    }
    return Entry(
        name, device.title, preset_file(DEVICES, ".json", name, device_names()), figures_by_name, device.source
    )


def _rig(name: str) -> Entry:
    """Return the entry of a rig of cameras in the catalogue."""
    rig = load_rig(name)
    figures_by_name = {
        "cameras": [camera.name for camera in rig.cameras],
        "lenses": list(dict.fromkeys(camera.model for camera in rig.cameras)),
        "megapixels": [round(camera.width * camera.height / 1e6, 1) for camera in rig.cameras],
    }
    return Entry(name, rig.title, preset_file(RIGS, ".json", name, rig_names()), figures_by_name, rig.source)


def _recipe(name: str) -> Entry:
    """Return the entry of a recipe in the catalogue."""
    recipe = load_recipe(name)
    splits = Counter(split for group in recipe.groups for split in group.splits())
    figures_by_name = {
        "scenes": sum(group.scenes for group in recipe.groups),
        "splits": dict(splits),
        "scenario": recipe.scenario,
        "layouts": list(recipe.layouts),
    }
    file = preset_file(RECIPES, ".yaml", name, recipe_names())
    return Entry(name, recipe.title, file, figures_by_name, " ".join(recipe.description.split()))


def _classes(name: str) -> Entry:
    """Return the entry of a scheme of classes in the catalogue."""
    rows = class_scheme(name).rows
    table = [
        {"id": row.id, "name": row.name, "las": row.las, "of": [_member(member) for member in row.of]} for row in rows
    ]
    return Entry(name, f"{len(rows)} classes", scheme_file(name), {"classes": table})


def _member(member: Member) -> str | int:
    """Return a member of a class as its name or number, and a selector as text `field=value ...`."""
    if not isinstance(member, ClassSelector):
        return member
    values = {key: value for key, value in member.to_dict().items() if key != "where" and value} | member.where
    return " ".join(f"{key}={value}" for key, value in values.items())


def _assets(name: str) -> Entry:
    """Return the entry of a library of assets in the catalogue."""
    classes = {key: asset.class_name for key, asset in read_asset_library(name).assets.items()}
    return Entry(name, f"{len(classes)} assets", library_file(name), {"assets": classes})


def _materials(name: str) -> Entry:
    """Return the entry of a table of materials in the catalogue."""
    table = read_material_table(name)
    figures_by_name = {"materials": {key: round(row.reflectivity, 3) for key, row in table.items()}}
    return Entry(name, f"{len(table)} materials in place of the usual ones", material_table_path(name), figures_by_name)


def _format(name: str) -> Entry:
    """Return the entry of a format of files in the catalogue, with what it holds and loses."""
    losses = format_losses(name)
    texts: dict[str, object] = {"kind": losses.kind, "writes": losses.file}
    figures_by_name = texts | {"holds": list(losses.holds), "loses": list(losses.loses)}
    return Entry(name, losses.label, losses.source, figures_by_name)


def _format_rows(item: Entry) -> list[list[str]]:
    """Return the table rows of a format: what it holds and what it loses, in lines of a readable length."""
    rows = [
        ["" if number else title, line]
        for title, items in (("holds", item.figures["holds"]), ("loses", item.figures["loses"]))
        for number, line in enumerate(wrap("; ".join(items) or "-", _LINE))
    ]
    heads = [[item.figures["kind"], item.figures["writes"]], *[["", ""]] * (len(rows) - 1)]
    return [[*head, *row] for head, row in zip(heads, rows, strict=True)]


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
    "rigs": Kind(
        "Rigs of cameras",
        "--set scan.cameras.rig=NAME",
        rig_names,
        _rig,
        (".json",),
        ("what it is", "cameras", "lenses", "megapixels"),
        figures("cameras", "lenses", "megapixels", cameras=lambda names: str(len(names)), megapixels=range_text),
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
    "formats": Kind(
        "Formats of files: clouds, sweeps, scenes and models",
        "--cloud, --sweeps or --twin NAME, --set 'scene_formats=[\"NAME\"]'",
        format_names,
        _format,
        (),
        ("kind", "file", "", ""),
        _format_rows,
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
