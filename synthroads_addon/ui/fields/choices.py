"""Menus whose items say more than the schema does: what each choice stands for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from ...base.errors import InputError
from ...cloud.formats.registry import missing_package
from ...road.guidelines import SECTIONS_OF_CLASS, STANDARD_CROSS_SECTIONS
from ...scanning.devices.device import Device, load_device
from ...scenario.road import RoadScenario
from ...scenario.scenario import FIDELITIES
from .wording import value_name

Items = Sequence[tuple[str, str, str]]
BY_HAND = "BY_HAND"
"""Item of a choice that stands for a part by hand."""
BY_HAND_ENDING = "_by_hand"
"""Ending of the property of a part by hand, beside the choice of a standard one."""


def _fidelities() -> Iterator[tuple[str, str, str]]:
    for name, settings in FIDELITIES.items():
        rays = "1 ray" if settings.rays_per_pulse == 1 else f"{settings.rays_per_pulse} rays"
        model = f"{1000 * settings.tolerance:g} mm chord error, {settings.vegetation_detail:.0%} of the plants"
        yield name, name.title(), f"{model}, {rays} per pulse"


def _cross_sections() -> Iterator[tuple[str, str, str]]:
    for name, section in STANDARD_CROSS_SECTIONS.items():
        lanes, title = len(section.lanes), name.replace("RQ", "RQ ")
        if section.single:
            oncoming_lanes = len(section.of_side("left").lanes)
            widths = f"one carriageway of {section.total_width - 2.0 * section.verge:g} m"
            yield name, f"{title}, {lanes} + {oncoming_lanes} lanes", f"{widths}, {lanes} and {oncoming_lanes} lanes"
            continue
        shoulder = f"hard shoulders of {section.hard_shoulder:g} m, median of {section.median:g} m"
        yield name, f"{title}, 2 × {lanes} lanes", f"{lanes} lanes each way, {shoulder}"


def _design_classes() -> Iterator[tuple[str, str, str]]:
    for name, sections in SECTIONS_OF_CLASS.items():
        yield name, value_name(name, RoadScenario.model_fields["design_class"]), f"With {', '.join(sections)}"


ITEMS: dict[str, Items] = {"fidelity": tuple(_fidelities()), "road.design_class": tuple(_design_classes())}
"""Path of a choice and its items."""
STANDARD_PARTS: dict[str, Items] = {"road.cross_section": tuple(_cross_sections())}
"""Path of a field that takes a standard part's name or a part by hand, and the standard parts."""


def is_offered(path: str, name: str) -> bool:
    """Return whether one of the values of the field at a path can be chosen here: not what has to be brought by pip."""
    return path != "cloud.formats" or not missing_package(f".{name}")


def device_of(name_or_file: str) -> Device | None:
    """Return the device of a name or JSON file, None if it can't be read; cached until the file changes."""
    path = Path(name_or_file)
    try:
        changed = path.stat().st_mtime_ns if path.suffix == ".json" else 0
    except OSError:
        return None
    return _device(name_or_file, changed)


@lru_cache(maxsize=64)
def _device(name_or_file: str, changed: int) -> Device | None:
    try:
        return load_device(name_or_file)
    except InputError:
        return None
