"""What comes under a name, kind by kind, with its key figures: scenarios, laser scanners, recipes, classes, and others.

Files of one's own are described in the same way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..base.classes import class_scheme, scheme_names
from ..base.errors import InputError, nearest_name
from ..base.files import PRESETS
from ..dataset.recipe import RECIPES, load_recipe, recipe_names
from ..materials.table import material_table_path, read_material_table
from ..road.things.assets import library_file, library_names, read_asset_library
from ..scanning.devices.device import DEVICES, device_names, load_device
from ..scenario.scenario import SCENARIOS, load_scenario, scenario_names


@dataclass(frozen=True)
class Entry:
    """One thing that comes under a name.

    Attributes:
        name: as it is given to a command; of a file of one's own its path.
        title: what it is, in one line.
        file: that describes it.
        figures: its key figures by name, JSON data.
        note: what else is said of it; empty if nothing is.
    """

    name: str
    title: str
    file: Path
    figures: dict[str, Any] = field(default_factory=dict)
    note: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON data."""
        said = {"name": self.name, "title": self.title, **self.figures, "file": str(self.file)}
        return said | ({"note": self.note} if self.note else {})


def plain(value: Any) -> str:
    """Return a figure as text: numbers short, lists with commas, of counts the name before."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {plain(number)}" for name, number in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(map(plain, value))
    return f"{value:g}" if isinstance(value, float) else "-" if value is None else str(value)


def span(values: Sequence[float]) -> str:
    """Return the smallest and the largest of some numbers as text."""
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


Rows = Callable[[Entry], Sequence[Sequence[str]]]
"""From an entry to its rows of a table: one, or one for each of its parts."""


@dataclass(frozen=True)
class Kind:
    """A kind of things that come under a name.

    Attributes:
        title: of all of them.
        use: how one is given to a command.
        names: of what is shipped.
        read: from a name or a file of one's own to what it is; raises `InputError`.
        endings: of the files.
        head: titles of a table's columns behind the name.
        rows: cells behind the name.
    """

    title: str
    use: str
    names: Callable[[], list[str]]
    read: Callable[[str], Entry]
    endings: tuple[str, ...]
    head: tuple[str, ...]
    rows: Rows


def figures(*names: str, **shown: Callable[[Any], str]) -> Rows:
    """Return what makes one row of an entry: its title, then some of its figures.

    Args:
        names: of the figures, in the order of the columns.
        shown: by the name of a figure, how it is written where not plainly.
    """
    return lambda one: [[one.title, *(shown.get(name, plain)(one.figures[name]) for name in names)]]


def entries(kind: Kind, wanted: Sequence[str] = ()) -> list[Entry]:
    """Return what is shipped of a kind, or what is wanted of it.

    Args:
        kind: of the things.
        wanted: beginnings of names, files of one's own, and folders of such files; empty for all that is shipped.

    Raises:
        InputError: no name begins so, or a file is wrong.
    """
    if not wanted:
        return [kind.read(name) for name in kind.names()]
    found = (name for text in wanted for name in _named(kind, text))
    return [kind.read(name) for name in dict.fromkeys(found)]


def _named(kind: Kind, text: str) -> list[str]:
    """Return the names that begin with a text, the file that it is, or the files in the folder that it is."""
    names = [name for name in kind.names() if name.startswith(text)]
    path = Path(text)
    if names:
        return names
    if path.suffix.lower() in kind.endings:
        return [text]
    files = sorted(str(file) for file in path.glob("*") if file.suffix.lower() in kind.endings) if path.is_dir() else []
    if not files:
        endings = " or ".join(kind.endings)
        allowed = f"must be a {endings} file, a folder of such files, or the beginning of {', '.join(kind.names())}"
        raise InputError(kind.title.lower(), text, f"{allowed}{nearest_name(text, kind.names())}")
    return files


def preset(folder: Path, ending: str, name_or_file: str, names: Sequence[str]) -> Path:
    """Return the file of something shipped, or the one named."""
    return folder / f"{name_or_file}{ending}" if name_or_file in names else Path(name_or_file)


def _scenario(name: str) -> Entry:
    made = load_scenario(name)
    section = made.road.cross_section
    told = {
        "cross_section": section if isinstance(section, str) else "by hand",
        "design_class": made.road.design_class,
        "length": made.road.length,
        "platform": made.scan.platform.kind,
        "device": made.scan.device,
        "fidelity": made.fidelity,
    }
    return Entry(name, made.title, preset(SCENARIOS, ".json", name, scenario_names()), told)


def _device(name: str) -> Entry:
    made = load_device(name)
    told = {
        "pattern": made.pattern.type,
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
    return Entry(name, made.title, preset(DEVICES, ".json", name, device_names()), told, made.source)


def _recipe(name: str) -> Entry:
    made = load_recipe(name)
    splits = Counter(split for group in made.groups for split in group.splits())
    told = {
        "scenes": sum(group.scenes for group in made.groups),
        "splits": dict(splits),
        "scenario": made.scenario,
        "layouts": list(made.layouts),
    }
    file = preset(RECIPES, ".yaml", name, recipe_names())
    return Entry(name, made.title, file, told, " ".join(made.description.split()))


def _classes(name: str) -> Entry:
    rows = class_scheme(name).rows
    shipped = {"17": PRESETS / "classes.json", "5": PRESETS / "classes_5.json"}
    table = [{"id": row.id, "name": row.name, "las": row.las, "of": list(row.of)} for row in rows]
    return Entry(name, f"{len(rows)} classes", shipped.get(name, Path(name)), {"classes": table})


def _assets(name: str) -> Entry:
    made = {key: asset.class_name for key, asset in read_asset_library(name).assets.items()}
    return Entry(name, f"{len(made)} assets", library_file(name), {"assets": made})


def _materials(name: str) -> Entry:
    made = read_material_table(material_table_path(name))
    told = {"materials": {key: round(row.reflectivity, 3) for key, row in made.items()}}
    return Entry(name, f"{len(made)} materials in place of the usual ones", material_table_path(name), told)


def _table_names() -> list[str]:
    return sorted(path.stem for path in (PRESETS / "material_tables").glob("*.json"))


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
            field_of_view_deg=span,
            lines_per_second=span,
            maximum_ranges=span,
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
            [str(row["id"]), row["name"], str(row["las"]), plain(row["of"])] for row in one.figures["classes"]
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
        _table_names,
        _materials,
        (".json",),
        ("material", "reflectivity"),
        lambda one: [[name, f"{value:.3f}"] for name, value in one.figures["materials"].items()],
    ),
}
"""What can be listed of scenes and scans, by the name of its kind; `ml.catalogue` has the rest."""
