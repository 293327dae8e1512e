"""Instance numbers over two epochs: what stays keeps its numbers, what is new gets numbers that nothing had before."""

from __future__ import annotations

from collections.abc import Iterable

from ..instances import InstanceNumbers
from ..parameters import RoadParameters
from ..section import Carriageway, Pavement
from .change import Edit

_LISTS = ("ruts", "potholes", "patches", "cracks", "removed_markings")
"""Lists of a pavement's damages in the order of their numbers."""


def first_unused(parameters: RoadParameters) -> int:
    """Return the lowest instance number from which on a set has neither objects nor parts."""
    numbers = InstanceNumbers(parameters)
    last = max(item.instance for item in parameters.objects.values())
    for parts in numbers.parts.values():
        last = max(last, *parts.stated, parts.first + parts.room - 1)
    return last + 1


def kept_numbers(
    before: RoadParameters, after: RoadParameters, edits: Iterable[Edit]
) -> dict[str, tuple[int, ...]] | None:
    """Return the numbers of parts that the second set has to state, so that those of the first stay; None if none.

    Args:
        before: set of the first epoch.
        after: of the second, which states none.
        edits: that turn the one into the other.
    """
    edits = list(edits)
    first, natural = InstanceNumbers(before), InstanceNumbers(after)
    unused = max(first_unused(before), 1 + max(item.instance for item in after.objects.values()))
    result: dict[str, tuple[int, ...]] = {}
    for name, parts in natural.parts.items():
        item = after.objects[name]
        if isinstance(item, Carriageway):
            former = before.objects.get(name)
            if not isinstance(former, Carriageway):
                former = None
            former_parts = first.parts.get(name)
            former_numbers = former_parts.all_numbers().tolist() if former_parts else []
            numbers = _damage_numbers(former, former_numbers, item, [edit for edit in edits if edit.thing == name])
            fresh = iter(range(unused, unused + len(numbers)))
            result[name] = tuple(next(fresh) if number is None else number for number in numbers)
            unused += sum(number is None for number in numbers)
        elif name in first.parts and first.parts[name].kind == parts.kind:
            result[name] = (first.parts[name].first,)
        else:
            result[name] = (unused,)
            unused += parts.room
    is_natural = all(
        natural.parts[name].all_numbers().tolist() == list(numbers)
        if natural.parts[name].kind == "damage"
        else natural.parts[name].first == numbers[0]
        for name, numbers in result.items()
    )
    return None if is_natural else result


def _damage_numbers(
    former: Carriageway | None, former_numbers: list[int], item: Carriageway, edits: list[Edit]
) -> list[int | None]:
    """Return the numbers of a carriageway's damages in the second epoch, None for those that are new.

    Args:
        former: the carriageway in the first epoch.
        former_numbers: of its damages.
        item: in the second.
        edits: of it.
    """
    result: list[int | None] = []
    begin = 0
    for name in _LISTS:
        count = len(_items(former.pavement, name)) if former else 0
        numbers: list[int | None] = list(former_numbers[begin : begin + count])
        begin += count
        places = {True: [], False: []}  # type: dict[bool, list[int]]
        for edit in edits:
            if edit.path.startswith(f"pavement.{name}.") and (edit.before is None or edit.after is None):
                places[edit.before is None].append(int(edit.path.rpartition(".")[2]))
        for place in sorted(places[False], reverse=True):
            del numbers[place]
        for place in sorted(places[True]):
            numbers.insert(place, None)
        wanted = len(_items(item.pavement, name))
        # A whole list that was replaced has no elements in common with the former one.
        result += numbers if len(numbers) == wanted else [None] * wanted
    return result


def _items(pavement: Pavement, name: str) -> tuple[object, ...]:
    """Return one list of a pavement's damages."""
    return tuple(getattr(pavement, name))
