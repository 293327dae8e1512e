"""The changes between two parameter sets of a road: the reverse of `edits.apply_changes`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..parameters import RoadParameters
from .change import KINDS, Change, ChangeList, Edit, Kind
from .describe import describe
from .edits import find_edits
from .kinds import EditKind, is_condition, kind_of


def diff_roads(before: RoadParameters, after: RoadParameters, years: float | None = None) -> ChangeList:
    """Return the list of changes that turns one parameter set into another.

    Args:
        before: of the first epoch.
        after: of the second.
        years: between them, if known.
    """
    edits, own_numbers, order = find_edits(before, after)
    objects = {**before.to_dict()["objects"], **after.to_dict()["objects"]}
    changes, conditions = group_edits(edits, objects, before.alignment.length)
    return ChangeList(
        schema="synthroads/changes-1.0",
        before=before.metadata.identifier,
        after=after.metadata.identifier,
        years=years,
        changes=changes,
        circumstances=conditions,
        own_numbers=own_numbers or None,
        order=order,
    )


def group_edits(
    edits: Sequence[Edit], objects: Mapping[str, Any], length: float
) -> tuple[tuple[Change, ...], tuple[Edit, ...]]:
    """Return the changes that edits are, and the edits that are conditions.

    Args:
        edits: of two sets.
        objects: data of the objects of both sets by id, those of the second first.
        length: of the road, m.
    """
    groups: dict[EditKind, list[Edit]] = {}
    conditions = []
    for edit in edits:
        if is_condition(edit, objects):
            conditions.append(edit)
        else:
            groups.setdefault(kind_of(edit, objects, edits), []).append(edit)
    return in_order(
        [make_change(kind.kind, kind.detail, items, objects, length) for kind, items in groups.items()]
    ), tuple(conditions)


def make_change(kind: Kind, detail: str, edits: Iterable[Edit], objects: Mapping[str, Any], length: float) -> Change:
    """Return the change of a kind that edits are together; its number is that of the first in a list.

    Args:
        kind, detail: what happened.
        edits: what it is in the sets.
        objects: data of the objects of both sets by id, those of the second first.
        length: of the road, m.
    """
    ordered = tuple(sorted(edits, key=lambda edit: (edit.thing, edit.path, edit.before is None)))
    extent, size, unit = describe(kind, detail, ordered, objects, length)
    things = tuple(dict.fromkeys(edit.thing for edit in ordered if edit.thing))
    return Change(
        id="change",
        number=1,
        kind=kind,
        detail=detail,
        things=things,
        extent=extent,
        size=size,
        unit=unit,
        edits=ordered,
    )


def in_order(changes: Sequence[Change]) -> tuple[Change, ...]:
    """Return changes in the order of their stations, then of kinds and things, with ids and numbers by that order."""

    def key(change: Change) -> tuple[Any, ...]:
        """Return the place of a change among others."""
        first = change.edits[0]
        return change.extent.start_station, KINDS.index(change.kind), change.detail, first.thing, first.path

    return tuple(
        change.model_copy(update={"id": f"change-{number:04d}", "number": number})
        for number, change in enumerate(sorted(changes, key=key), 1)
    )
