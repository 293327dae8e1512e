"""The formats of sweeps by name: what each is called, what it writes, and what it holds and loses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal, get_args

from .sweep import SweepPlace
from .writer import SweepWriter

SweepFormat = Literal["kitti", "semantickitti", "nuscenes", "openlabel"]
SWEEP_FORMATS: tuple[SweepFormat, ...] = get_args(SweepFormat)


@dataclass(frozen=True)
class SweepEntry:
    """A format of sweeps.

    Attributes:
        label: for people.
        file: name of the file or folder that it writes.
        writer: module beside this one, and class in it.
        holds, loses: what of a scan's points and things is in it, and what isn't, in words.
    """

    label: str
    file: str
    writer: tuple[str, str]
    holds: str
    loses: str


ENTRIES: dict[str, SweepEntry] = {
    "kitti": SweepEntry(
        "KITTI",
        "kitti",
        ("kitti", "KittiWriter"),
        "points with remission by sweep; upright boxes of what a camera ahead has in its image, with occlusion and "
        "truncation",
        "classes and instances of points; tracks; boxes beside and behind; tilt of boxes; times and poses",
    ),
    "semantickitti": SweepEntry(
        "SemanticKITTI",
        "semantickitti",
        ("semantic_kitti", "SemanticKittiWriter"),
        "points with remission, class and instance by sweep; poses and times",
        "boxes; map coordinates, of which sweeps.json has the origin; colours, returns, times of points",
    ),
    "nuscenes": SweepEntry(
        "nuScenes",
        "nuscenes",
        ("nuscenes", "NuscenesWriter"),
        "points with intensity and class by sweep; oriented boxes with points and visibility, and their tracks; poses "
        "and times",
        "instances of points; maps and logs; colours, returns, times of points",
    ),
    "openlabel": SweepEntry(
        "OpenLABEL",
        "openlabel.json",
        ("openlabel", "OpenlabelWriter"),
        "oriented boxes, whole and as seen, with points, occlusion and velocity, and their tracks; poses and times",
        "points",
    ),
}
"""Every format of sweeps by its name."""

SWEEPS = "sweeps.json"
"""Name of the file that says for all formats what each sweep is."""


def sweep_file_names(formats: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the files and folders that formats are written to, `SWEEPS` first; none without a format."""
    names = tuple(ENTRIES[name].file for name in formats)
    return (SWEEPS, *names) if names else ()


def open_sweep_writer(name: str, folder: Path, place: SweepPlace) -> SweepWriter:
    """Return the writer of a format, which writes into a folder that is there."""
    module, writer = ENTRIES[name].writer
    make: type[SweepWriter] = getattr(import_module(f".{module}", __package__), writer)
    return make(folder / ENTRIES[name].file, place)
