"""Two epochs of a road as they are read to judge a detector, and the results of one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arrays import AnyArray, Bool, Float
from ...base.errors import InputError
from ...base.schema import read_json
from ...cloud.formats.registry import open_cloud
from ...road.changes.change import ChangeList, read_changes
from ...scanning.epochs.truth import CODES, MOBILE, UNCHANGED

_CLOUDS = ("cloud.laz", "cloud.las", "cloud.npz", "cloud.ply", "cloud.e57")
_TRUTH = ("change", "change_id", "change_distance", "not_seen_before")
REGISTRATION = "registration.json"
"""File in the folder of an epoch that says how far its cloud is displaced."""
DISTANCES, LABELS = ("change_distance", "distance"), ("change", "label", "predicted_class")
"""Names under which a result has its distances and its labels."""


@dataclass(frozen=True)
class EpochPoints:
    """Points of an epoch with the truth of their changes.

    Attributes:
        xyz: (N, 3) map coordinates, m.
        change, change_id: (N,) codes of kinds (`scanning.epochs.truth.CODES`), and numbers of changes.
        distance: (N,) true distances to the other epoch, m.
        hidden: (N,) whether the epoch before couldn't see the place.
    """

    xyz: Float
    change: AnyArray
    change_id: AnyArray
    distance: Float
    hidden: Bool

    @property
    def judged(self) -> Bool:
        """Return which points (N,) a detector is judged by: not traffic, and not what wasn't seen before."""
        return np.asarray(~self.hidden & (self.change != MOBILE))


def cloud_of(folder: Path) -> Path:
    """Return the cloud in an epoch's folder, or the file itself; InputError where there is none."""
    if folder.is_file():
        return folder
    for name in _CLOUDS:
        if (folder / name).is_file():
            return folder / name
    raise InputError(str(folder), None, f"must be a cloud or a folder with one of {', '.join(_CLOUDS)}")


def read_points(path: Path) -> EpochPoints:
    """Return the points of an epoch's cloud; InputError if it has no layer of changes."""
    columns: dict[str, list[AnyArray]] = {name: [] for name in ("xyz", *_TRUTH)}
    with open_cloud(cloud_of(path)) as cloud:
        for block in cloud.blocks():
            columns["xyz"].append(block.xyz)
            for name in _TRUTH:
                values = block.array(name)
                if values is None:
                    text = f"has no {name}: a cloud of `synthroads epochs` is needed"
                    raise InputError(str(path), None, text)
                columns[name].append(values)
    arrays = {name: np.concatenate(parts) if parts else np.empty(0) for name, parts in columns.items()}
    return EpochPoints(
        arrays["xyz"],
        arrays["change"],
        arrays["change_id"],
        arrays["change_distance"].astype(np.float64),
        arrays["not_seen_before"].astype(bool),
    )


def stated_registration(path: Path) -> float:
    """Return the registration error, m, that an epoch's folder states between its cloud and that of the one before.

    Raises:
        InputError: it states none.
    """
    folder = path if path.is_dir() else path.parent
    file = folder / REGISTRATION
    value = read_json(file).get("registration_error") if file.is_file() else None
    if not isinstance(value, int | float):
        text = "states no registration_error: give a number, or --registration estimated"
        raise InputError(str(file), None, text)
    return float(value)


def read_places(path: Path) -> Float:
    """Return the map coordinates (N, 3), m, of the points of a cloud, or of the one in an epoch's folder."""
    with open_cloud(cloud_of(path)) as cloud:
        parts = [block.xyz for block in cloud.blocks()]
    return np.concatenate([np.empty((0, 3)), *parts])


@dataclass(frozen=True)
class Detected:
    """Result of a detector: distances or labels of the second epoch's points, or a list of changes.

    Attributes:
        distance: (N,) m; NaN where it has none.
        label: (N,) codes of kinds, 0 unchanged; of a detector that knows no kinds any number for changed.
        detection_limit: (N,) least distance that counts as a change, m; None where it says none.
        changes: the list.
    """

    distance: Float | None = None
    label: AnyArray | None = None
    detection_limit: Float | None = None
    changes: ChangeList | None = None

    def changed(self, limit: float) -> Bool | None:
        """Return which points (N,) are changed by labels, else by distances beyond the result's limits or this (m)."""
        if self.label is not None:
            return np.asarray(self.label != UNCHANGED)
        if self.distance is None:
            return None
        least = limit if self.detection_limit is None else np.nan_to_num(self.detection_limit, nan=np.inf)
        return np.asarray(np.abs(np.nan_to_num(self.distance)) > least)

    @property
    def knows_kinds(self) -> bool:
        """Return whether its labels are kinds: numbers of them, more than one."""
        return self.label is not None and len(np.unique(self.label[self.label != UNCHANGED])) > 1


def read_result(path: Path, count: int) -> Detected:
    """Return a detector's result: ``.npz`` or LAS with a value for each of N points, or a list of changes (JSON).

    Raises:
        InputError: it has neither distances nor labels, or of another number of points.
    """
    if path.suffix == ".json":
        read_json(path)
        return Detected(changes=read_changes(path))
    values = _npz_values(path) if path.suffix == ".npz" else _las_values(path)
    for name, array in values.items():
        if len(array) != count:
            text = f"must have a value for each of the {count:,} points of the second epoch, in their order"
            raise InputError(f"{path}: {name}", len(array), text)
    distance = next((values[name] for name in DISTANCES if name in values), None)
    label = next((values[name] for name in LABELS if name in values), None)
    if distance is None and label is None:
        names = ", ".join((*DISTANCES, *LABELS))
        raise InputError(str(path), None, f"must have distances or labels of the points: an array named {names}")
    limit = values.get("detection_limit")
    return Detected(None if distance is None else distance.astype(np.float64), label, limit)


def _npz_values(path: Path) -> dict[str, AnyArray]:
    """Return the arrays of distances, labels and limits of an NPZ file."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in (*DISTANCES, *LABELS, "detection_limit") if name in data}
    except (OSError, ValueError) as error:
        raise InputError(str(path), None, f"can't be read ({error})") from None


def _las_values(path: Path) -> dict[str, AnyArray]:
    """Return the columns of distances and labels of a LAS or LAZ file."""
    import laspy  # other formats need none

    try:
        las = laspy.read(path)
    except (OSError, ValueError, laspy.LaspyException) as error:
        raise InputError(str(path), None, f"can't be read ({error})") from None
    names = set(las.point_format.dimension_names)
    return {name: np.asarray(las[name]) for name in (*DISTANCES, *LABELS, "detection_limit") if name in names}


NAMES = {code: kind for kind, code in CODES.items()}
"""Kinds by their codes."""
