"""Classes of training data: whatever a source calls its classes, as numbers of the scheme that is learned."""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from synthroads_addon.base.classes import UNLABELLED, ClassScheme, ClassSelector, class_scheme
from synthroads_addon.base.errors import InputError, nearest_name
from synthroads_addon.base.schema import Model, read_json

from ..configuration import SHIPPED, shipped_file

MAPPINGS = SHIPPED / "classes"
"""Folder of the shipped mappings."""
IGNORED = -1
"""Label of points that count nowhere."""


class LabelMapping(Model):
    """Mapping from the class numbers of another data set's files to class names; numbers not named are ignored."""

    vendor_keys_allowed: ClassVar[bool] = False

    title: str = Field("", description="Kind of files that the mapping is for.")
    field: str = Field(
        "classification", min_length=1, description="Attribute of the file that contains the class numbers."
    )
    axis: str = Field(
        "",
        description="File of the road's axis (CSV or GeoJSON) beside the cloud, for clouds without classes: the class "
        "number of a point then is 1 where the offset from the axis is in `paved`, else 0.",
    )
    paved: tuple[tuple[float, float], ...] = Field(
        (), description="Smallest and largest offset from the axis of each pavement, left positive, m."
    )
    classes: dict[str, str] = Field(min_length=1, description="Class, or group of classes, of each number in the file.")
    groups: dict[str, tuple[str, ...]] = Field(
        {}, description="Classes of each group, which count as one class in scores; for data with coarser classes."
    )
    ignore_zero_intensity: bool = Field(
        False, description="Ignore points with intensity 0, whose intensity wasn't measured."
    )

    @model_validator(mode="after")
    def _check_pavements(self) -> Self:
        """Refuse an axis without pavements, pavements without an axis, and offsets that don't ascend."""
        if bool(self.axis) != bool(self.paved):
            raise ValueError("axis and paved must be given together")
        for smallest, largest in self.paved:
            if not smallest < largest:
                raise ValueError(f"paved has {smallest:g}, {largest:g}: each must be two ascending offsets")
        return self

    def targets(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names that the mapped truth distinguishes, in order: its groups if it has any, else `names`.

        Args:
            names: names of the scheme's classes.

        Raises:
            InputError: a number stands for something that is neither a class nor a group, or a group names no class.
        """
        for group, members in self.groups.items():
            for member in members:
                if member not in names:
                    hint = nearest_name(member, names)
                    raise InputError(f"groups.{group}", member, f"must be one of {', '.join(names)}{hint}")
        target_names = tuple(self.groups) if self.groups else names
        for number, name in self.classes.items():
            if not number.lstrip("-").isdigit():
                raise InputError("classes", number, 'must be whole numbers as text, e.g. "40"')
            if name not in target_names:
                raise InputError(
                    f"classes.{number}",
                    name,
                    f"must be one of {', '.join(target_names)}{nearest_name(name, target_names)}",
                )
        return target_names

    def label(self, numbers: NDArray[np.integer], names: tuple[str, ...]) -> NDArray[np.int16]:
        """Return the index in `targets(names)` of each number (N,) of a file; `IGNORED` (-1) where it isn't mapped."""
        index_by_name = {name: class_index for class_index, name in enumerate(self.targets(names))}
        table = {int(number): index_by_name[name] for number, name in self.classes.items()}
        distinct_numbers, inverse = np.unique(numbers, return_inverse=True)
        indices = np.array([table.get(int(number), IGNORED) for number in distinct_numbers], dtype=np.int16)
        return indices[inverse.reshape(-1)] if len(distinct_numbers) else np.zeros(0, dtype=np.int16)

    def group_of(self, names: tuple[str, ...]) -> NDArray[np.int16]:
        """Return the index in `targets(names)` of each predicted class (C,); `IGNORED` (-1) where no group has it."""
        targets = self.targets(names)
        if not self.groups:
            return np.arange(len(names), dtype=np.int16)
        table = np.full(len(names), IGNORED, dtype=np.int16)
        for group_index, group in enumerate(targets):
            table[[names.index(member) for member in self.groups[group]]] = group_index
        return table


def load_mapping(name_or_file: str) -> LabelMapping:
    """Return a shipped mapping (``semantickitti``, ``ign``, ...) or one from a JSON file.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file holds no mapping.
    """
    path = shipped_file("mapping", MAPPINGS, name_or_file, [".json"])
    return LabelMapping.from_dict(read_json(path), str(name_or_file))


def class_names(scheme: ClassScheme) -> tuple[str, ...]:
    """Return the names of a scheme's classes in the order of the network's outputs."""
    return tuple(row.name for row in scheme.rows)


def table_between(source: Mapping[int, str], scheme: ClassScheme, where: str) -> NDArray[np.int16]:
    """Return a (256,) table from a source's class ids to indices of the scheme's classes, by name; else `IGNORED` (-1).

    A source's class counts as the scheme's class of the same name, else as the one that it is merged into: 17 classes
    become 5, and the 5 never 17.

    Args:
        source: the source's class names by id.
        scheme: scheme of the classes that are learned.
        where: name of the source, for messages.

    Raises:
        InputError: a class of the source has no place in the scheme.
    """
    names = class_names(scheme)
    full_names = {row.id: row.name for row in class_scheme("17").rows}
    members: dict[str, int] = {}
    for class_index, row in enumerate(scheme.rows):
        for member in row.of:
            if not isinstance(member, ClassSelector):
                members[full_names.get(member, "") if isinstance(member, int) else member] = class_index
    table = np.full(256, IGNORED, dtype=np.int16)
    for number, name in source.items():
        if number == UNLABELLED or name == "unlabelled":
            continue
        index = names.index(name) if name in names else members.get(name)
        if index is None:
            class_list = ", ".join(names)
            raise InputError(f"{where}: classes", name, f"is no class of the scheme {scheme.name} ({class_list})")
        table[number] = index
    return table
