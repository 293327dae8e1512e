"""Outlines of patches and cracks in stations and offsets."""

from collections.abc import Iterator

import numpy as np

from ...base.arrays import Float
from ..section import Corner, Crack, Patch, Pavement, RemovedMarking
from .clipping import subtract

REMOVED_FILM, CRACK_FILM, PATCH_FILM = 0.0002, 0.0004, 0.0008
"""Height of the faces of removed markings, cracks and patches above the pavement, m, each over those before it. On a
marking cracks lie as far above its film, see `cover`; the others lie below any."""
_SHARPEST = 0.5
"""Cosine of half the turn beyond which a line's corner is not mitred any further."""


def patch_outline(patch: Patch) -> Float:
    """Return the outline (K, 2) of a patch, the convex hull of its corners, counter-clockwise from above.

    Corners on one line have none: K is less than 3. Andrew's monotone chain (1979).
    """
    corners = sorted(set(patch.outline))
    lower_chain, upper_chain = _chain(corners), _chain(corners[::-1])
    return np.array(lower_chain[:-1] + upper_chain[:-1]).reshape(-1, 2)


def _chain(corners: list[Corner]) -> list[Corner]:
    """Return one half of the convex hull of sorted corners: the chain with all others on its left."""
    chain: list[Corner] = []
    for corner in corners:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], corner) <= 0.0:
            chain.pop()
        chain.append(corner)
    return chain


def _turn(first: Corner, second: Corner, third: Corner) -> float:
    """Return twice the area of a triangle, positive against the clock."""
    station_difference, offset_difference = second[0] - first[0], second[1] - first[1]
    return station_difference * (third[1] - first[1]) - offset_difference * (third[0] - first[0])


def crack_outlines(crack: Crack) -> Iterator[Float]:
    """Yield the quadrilaterals (4, 2) along a crack's lines, counter-clockwise from above, one per leg.

    Neighbours of a line share an edge, which halves the corner; sharp corners are cut.
    """
    for line in crack.lines:
        corners = np.array(line)
        corners = corners[np.append(True, np.any(np.diff(corners, axis=0) != 0.0, axis=1))]
        if len(corners) < 2:
            continue
        legs = np.diff(corners, axis=0)
        legs /= np.linalg.norm(legs, axis=1)[:, None]
        normals = np.column_stack([-legs[:, 1], legs[:, 0]])
        normals_before, normals_behind = np.vstack([normals[:1], normals]), np.vstack([normals, normals[-1:]])
        bisectors = normals_before + normals_behind
        bisectors /= np.maximum(np.linalg.norm(bisectors, axis=1), 1e-9)[:, None]
        # A mitre: half the width over the cosine of half the turn, which is limited so that sharp corners are cut.
        mitre_lengths = crack.width / 2.0 / np.maximum(np.einsum("ij,ij->i", bisectors, normals_behind), _SHARPEST)
        left_edge, right_edge = (
            corners + bisectors * mitre_lengths[:, None],
            corners - bisectors * mitre_lengths[:, None],
        )
        for number in range(len(legs)):
            yield np.array([right_edge[number], right_edge[number + 1], left_edge[number + 1], left_edge[number]])


def removed_outlines(marking: RemovedMarking, pavement: Pavement, length: float) -> Iterator[Float]:
    """Yield the convex parts (K, 2) of a removed marking's dashes that no patch covers, counter-clockwise from above.

    Args:
        marking: the marking.
        pavement: that it was on.
        length: of the road, m.
    """
    patches = [outline for patch in pavement.patches if len(outline := patch_outline(patch)) > 2]
    for dash in _removed_dashes(marking, length):
        yield from subtract(dash, patches)


def _removed_dashes(marking: RemovedMarking, length: float) -> Iterator[Float]:
    """Yield the rectangles (4, 2) of a removed marking's dashes on a road of a length (m); one for a solid line."""
    right_edge, left_edge = marking.offset - marking.width / 2.0, marking.offset + marking.width / 2.0
    line_end, period = min(marking.end_station, length), marking.dash_length + marking.gap_length
    starts = np.arange(marking.start_station, line_end, period) if period else np.array([marking.start_station])
    for start in starts.tolist():
        dash_end = min(start + marking.dash_length, line_end) if period else line_end
        if dash_end > start:
            yield np.array([(start, right_edge), (dash_end, right_edge), (dash_end, left_edge), (start, left_edge)])
