"""From a road, a seed and limits to its next epoch: the list of its changes, and the parameter set after them."""

from __future__ import annotations

from collections.abc import Callable

from ...base.random_streams import stream
from ...road.changes.change import Change, ChangeList, Edit, read_changes
from ...road.changes.diff import in_order
from ...road.changes.edits import apply_changes
from ...road.parameters import RoadParameters
from ...scenario.changes import ChangeLimits
from . import pavement, things
from .drawing import Epoch

_DRAWERS: tuple[tuple[tuple[str, ...], Callable[[Epoch], None]], ...] = (
    (("construction_zone",), things.draw_zones),
    (("overlaid",), pavement.draw_overlays),
    (("settled",), pavement.draw_settlements),
    (("rutted",), pavement.draw_ruts),
    (("patched",), pavement.draw_patches),
    (("cracked",), pavement.draw_cracks),
    (("marked_anew",), pavement.draw_markings),
    (("worn",), pavement.draw_paint),
    (("moved",), things.draw_moved),
    (("removed",), things.draw_removed),
    (("damaged",), things.draw_hits),
    (("added",), things.draw_added),
    (("cut_back",), things.draw_cutting),
    (("grown",), things.draw_growth),
    (("parked",), things.draw_parked),
)
"""Kinds and what draws them: large ones first, as they need more room."""


def sample_changes(before: RoadParameters, limits: ChangeLimits, seed: int, epoch: int = 1) -> ChangeList:
    """Return the changes of a road up to its next epoch, drawn from a seed within limits, or read from a list.

    Each kind has random numbers of its own: leaving one out changes no other.

    Args:
        before: the road.
        limits: of what is drawn; no kinds: nothing is.
        seed: the same seed, road and limits give the same changes on every machine.
        epoch: number of the epoch that they lead to, from 1.

    Raises:
        InputError: the list of one's own can't be read.

    Example:
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> road = sample_road(RoadScenario(length=200.0), seed=7)
        >>> [change.kind for change in sample_changes(road, ChangeLimits(kinds=("rutted",)), seed=1).changes]
        ['rutted', 'rutted']
        >>> sample_changes(road, ChangeLimits(kinds=()), seed=1).changes
        ()
    """
    if limits.list_of is not None:
        return read_changes(limits.list_of)
    drawing = Epoch(before, limits, stream(seed, "changes", epoch))
    for kinds, draw in _DRAWERS:
        if set(kinds) & set(limits.kinds):
            drawing.rng = stream(seed, "changes", epoch, kinds[0])
            draw(drawing)
    changes: tuple[Change, ...] = in_order(drawing.finish())
    name = f"{before.metadata.road_identifier}+{epoch}"
    return ChangeList(
        schema="synthroads/changes-1.0",
        before=before.metadata.identifier,
        after=name,
        years=limits.years,
        changes=changes,
        circumstances=(Edit(thing="", path="metadata.identifier", before=before.metadata.identifier, after=name),),
    )


def next_epoch(
    before: RoadParameters, limits: ChangeLimits, seed: int, epoch: int = 1
) -> tuple[RoadParameters, ChangeList]:
    """Return the parameter set of a road's next epoch, and the changes that lead to it; see `sample_changes`."""
    changes = sample_changes(before, limits, seed, epoch)
    return apply_changes(before, changes), changes
