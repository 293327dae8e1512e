"""Differences of two parameter sets as edits of their JSON data, and the edits made to a set."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from difflib import SequenceMatcher
from typing import Any

from ...base.errors import InputError
from ...base.schema import compact_json
from ..parameters import RoadParameters
from .change import ChangeList, Edit
from .numbers import kept_numbers

OPTIONAL_LISTS = frozenset({"settlements", "overlays", "dents"})
"""Lists that a set leaves out where they are empty."""
_NUMBERS = "part_numbers"


def apply_changes(before: RoadParameters, changes: ChangeList) -> RoadParameters:
    """Return the parameter set of the second epoch: that of the first with a list of changes made to it.

    Raises:
        InputError: the list is of another set: a value that it replaces isn't there; names change, field and value.

    Example:
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.road.changes.diff import diff_roads
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> first = sample_road(RoadScenario(length=150.0), seed=3)
        >>> second = sample_road(RoadScenario(length=150.0), seed=4)
        >>> apply_changes(first, diff_roads(first, second)).to_json() == second.to_json()
        True
    """
    data = before.to_dict()
    _make_edits(data, changes.edits)
    if changes.order is not None:
        if set(changes.order) != set(data["objects"]):
            raise InputError("order", None, "must name all objects of the second set, each once")
        data["objects"] = {name: data["objects"][name] for name in changes.order}
    if not changes.own_numbers:
        data.pop(_NUMBERS, None)
        numbers = kept_numbers(before, RoadParameters.from_dict(data, "the changed set"), changes.edits)
        if numbers is not None:
            data[_NUMBERS] = {name: list(values) for name, values in numbers.items()}
    return RoadParameters.from_dict(data, "the changed set")


def _make_edits(data: dict[str, Any], edits: Iterable[Edit]) -> None:
    """Make edits to a set's JSON data, in place: values, then what is taken away, then what is added."""
    edits = list(edits)
    replaced = [edit for edit in edits if edit.before is not None and edit.after is not None]
    removed = [edit for edit in edits if edit.after is None]
    added = [edit for edit in edits if edit.before is None]
    for edit in replaced:
        _check_before(data, edit)
        _set(data, edit)
    # The last elements of a list first, so that the places of the others stay.
    for edit in sorted(removed, key=lambda item: _list_place(item.path), reverse=True):
        _check_before(data, edit)
        _remove(data, edit)
    for edit in sorted(added, key=lambda item: (item.path != "", item.place or 0, _list_place(item.path))):
        _add(data, edit)


def _container(data: dict[str, Any], edit: Edit, create: bool = False) -> tuple[Any, str]:
    """Return what holds an edit's value, and its key there.

    Args:
        data: of the set.
        edit: the edit.
        create: whether a list that isn't there is made.

    Raises:
        InputError: the set has no such object or field.
    """
    if edit.path == "":
        return data["objects"], edit.thing
    if edit.thing and edit.thing not in data["objects"]:
        raise InputError(f"changes: {edit.thing}", None, "isn't in the first set: the list is of another road")
    holder: Any = data["objects"][edit.thing] if edit.thing else data
    *parents, key = edit.path.split(".")
    for number, name in enumerate(parents):
        is_list_of_key = number == len(parents) - 1 and key.isdigit()
        if create and is_list_of_key and isinstance(holder, dict) and name not in holder:
            holder[name] = []
        try:
            holder = holder[int(name)] if isinstance(holder, list) else holder[name]
        except (KeyError, IndexError, ValueError, TypeError):
            raise InputError(f"changes: {edit.thing}.{edit.path}", None, "isn't in the first set") from None
    return holder, key


def _check_before(data: dict[str, Any], edit: Edit) -> None:
    """Raise an InputError unless the value that an edit replaces or takes away is there."""
    holder, key = _container(data, edit)
    try:
        value = holder[int(key)] if isinstance(holder, list) else holder[key]
    except (KeyError, IndexError, ValueError):
        value = None
    if value != edit.before:
        text = f"must be {compact_json(edit.before)[:80]} as the list says: it is of another set"
        raise InputError(f"changes: {edit.thing}.{edit.path}", compact_json(value)[:80], text)


def _set(data: dict[str, Any], edit: Edit) -> None:
    """Replace an edit's value, in place."""
    holder, key = _container(data, edit)
    holder[int(key) if isinstance(holder, list) else key] = copy.deepcopy(edit.after)


def _remove(data: dict[str, Any], edit: Edit) -> None:
    """Take an edit's value away, in place, with a list that may be left out and is empty now."""
    holder, key = _container(data, edit)
    if not isinstance(holder, list):
        del holder[key]
        return
    del holder[int(key)]
    parent_path, _, name = edit.path.rpartition(".")[0].rpartition(".")
    if not holder and name in OPTIONAL_LISTS:
        parent: Any = data["objects"][edit.thing] if edit.thing else data
        for part in parent_path.split(".") if parent_path else ():
            parent = parent[part]
        del parent[name]


def _add(data: dict[str, Any], edit: Edit) -> None:
    """Add an edit's value, in place: an object or an element at its place, else a field."""
    holder, key = _container(data, edit, create=True)
    value = copy.deepcopy(edit.after)
    if isinstance(holder, list):
        holder.insert(int(key), value)
    elif edit.path == "" and edit.place is not None:
        items = list(holder.items())
        if key in holder:
            raise InputError(f"changes: {key}", None, "is in the first set already, so it can't be added")
        items.insert(edit.place, (key, value))
        holder.clear()
        holder.update(items)
    else:
        holder[key] = value


def _list_place(path: str) -> int:
    """Return the place in a list that a path ends with; -1 for another path."""
    last = path.rpartition(".")[2]
    return int(last) if last.isdigit() else -1


def find_edits(before: RoadParameters, after: RoadParameters) -> tuple[list[Edit], bool, tuple[str, ...] | None]:
    """Return the edits that turn one set's data into another's, and what they alone don't say.

    Returns:
        the edits; whether the second set numbers its parts by itself (`ChangeList.own_numbers`); the order of its
        objects, where those that stay are in another one.
    """
    first, second = before.to_dict(), after.to_dict()
    edits = list(_object_edits(first["objects"], second["objects"]))
    for name in {**first, **second}:
        if name not in ("objects", _NUMBERS):
            edits += _field_edits("", name, first.get(name), second.get(name))
    former_order = [name for name in first["objects"] if name in second["objects"]]
    order = [name for name in second["objects"] if name in first["objects"]]
    without = RoadParameters.from_dict({name: value for name, value in second.items() if name != _NUMBERS})
    own_numbers = kept_numbers(before, without, edits) != after.part_numbers
    if own_numbers and first.get(_NUMBERS) != second.get(_NUMBERS):
        edits.append(Edit(thing="", path=_NUMBERS, before=first.get(_NUMBERS), after=second.get(_NUMBERS)))
    return edits, own_numbers, tuple(second["objects"]) if former_order != order else None


def _object_edits(first: dict[str, Any], second: dict[str, Any]) -> Iterator[Edit]:
    """Yield the edits of objects: taken away, added at a place, replaced by one of another type, changed."""
    for name, item in first.items():
        if name not in second:
            yield Edit(thing=name, before=item)
        elif item.get("type") != second[name].get("type"):
            yield Edit(thing=name, before=item, after=second[name])
        else:
            for field in {**item, **second[name]}:
                yield from _field_edits(name, field, item.get(field), second[name].get(field))
    for place, (name, item) in enumerate(second.items()):
        if name not in first:
            yield Edit(thing=name, after=item, place=place)


def _field_edits(thing: str, path: str, first: Any, second: Any) -> Iterator[Edit]:
    """Yield the edits that turn one value of a field into another: of each field or list's element that differs."""
    if first == second and type(first) is type(second):
        return
    if isinstance(first, dict) and isinstance(second, dict) and not any("." in key for key in {**first, **second}):
        for key in {**first, **second}:
            yield from _field_edits(thing, f"{path}.{key}", first.get(key), second.get(key))
        return
    is_optional = path.rpartition(".")[2] in OPTIONAL_LISTS
    if is_optional and (first or second) and [] not in (first, second):
        first, second = first or [], second or []
    if _holds_elements(first) and _holds_elements(second) and (first or second):
        yield from _element_edits(thing, path, first, second)
    else:
        yield Edit(thing=thing, path=path, before=first, after=second)


def _holds_elements(value: Any) -> bool:
    """Return whether a value is a list of objects, of which each is a value of its own."""
    return isinstance(value, list) and all(isinstance(item, dict) for item in value)


def _element_edits(thing: str, path: str, first: list[Any], second: list[Any]) -> Iterator[Edit]:
    """Yield the edits that turn one list of objects into another: those that are alike stay."""
    before, after = ([compact_json(item) for item in items] for items in (first, second))
    for tag, a, a_end, b, b_end in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if tag == "equal":
            continue
        place = b
        for number in range(a, a_end):
            same = next((other for other in range(place, b_end) if _is_same(first[number], second[other])), None)
            if same is None:
                yield Edit(thing=thing, path=f"{path}.{number}", before=first[number])
                continue
            for other in range(place, same):
                yield Edit(thing=thing, path=f"{path}.{other}", after=second[other])
            yield Edit(thing=thing, path=f"{path}.{number}", before=first[number], after=second[same])
            place = same + 1
        for other in range(place, b_end):
            yield Edit(thing=thing, path=f"{path}.{other}", after=second[other])


_SIZES = frozenset({"depth", "height", "age", "thickness", "lines", "crossfall_percent", "width", "elevation"})
"""Fields of a list's objects that may differ where they are the same one in both epochs."""


def _is_same(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Return whether two objects of a list are one that changed: alike but for sizes, and lines from one place."""
    keys = ({*first, *second}) - _SIZES
    if any(first.get(key) != second.get(key) for key in keys):
        return False
    return bool("lines" not in first or first["lines"][0][0] == second["lines"][0][0])
