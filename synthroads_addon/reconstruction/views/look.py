"""All views of one road's axis, and what they agree on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.arrays import Float
from ..ground.band import find_band
from ..ground.paved import paved_spans
from ..layout import RoadLayout
from ..smoothing import fill_gaps
from .dark_band import view_band
from .extent import view_extent
from .fusion import APART, FusedAxis, fuse
from .markings import view_lines
from .pavement import view_brightness
from .period import view_period
from .skeleton import view_skeleton
from .symmetry import view_symmetry
from .view import View
from .vote import FoundAxis, axis_from_lines, axis_guides


def find_fused_axis(layout: RoadLayout, extra_views: Sequence[View] = ()) -> FusedAxis:
    """Return the axis that all rule-based views of a layout's profiles, and further ones (a network's), agree on.

    Args:
        layout: carriageways and lines in profiles along a path parallel to the road.
        extra_views: further views in the profiles' stretches.
    """
    lines = axis_from_lines(layout)
    return fuse(layout.profiles.middles, [*rule_views(layout, lines), *extra_views])


def rule_views(layout: RoadLayout, lines: FoundAxis) -> list[View]:
    """Return the rule-based views: of lines, marking period, ground, dark band, extent."""
    profiles, dual = layout.profiles, layout.kind == "dual"
    cores = [0.5 * (band.low + band.high) for band in layout.bands]
    axis_offset = float(np.median(lines.offsets))
    unevenness = _unevenness(layout)
    ground_views = [
        view_brightness(profiles, cores, dual),
        view_skeleton(profiles, cores).less_sure(0.5 * unevenness),
        view_symmetry(profiles).less_sure(unevenness + _pavement_beside(layout)),
    ]
    band_views: list[View] = []
    if not dual:  # two carriageways have two bands, and shoulders that differ from lanes
        band = view_band(find_band(profiles))
        band_views = [band]
        if not any(line.width > 0.0 for line in axis_guides(layout)):
            ground_views = [view.less_sure(_beside_band(view, band)) for view in ground_views]
    # With more lanes one way than the other the pavement's middle isn't the axis: the lines tell how far it is off.
    symmetric_views = [
        replace(view, offsets=view.offsets - layout.shift)
        for view in (*ground_views, *band_views, view_extent(profiles))
    ]
    period = view_period(profiles, dual, axis_offset)
    middle = None if dual else layout.bands[0].middle
    if middle is not None and middle.pair is not None and all(line.solid for line in middle.pair):
        period = View(period.name, np.full(profiles.stretches, np.nan), np.full(profiles.stretches, np.inf))
    return [view_lines(layout, lines), period, *symmetric_views]


def _beside_band(view: View, band: View) -> Float:
    """Return the distance (K,), m, of a view of all that looks like pavement from the dark band's middle.

    Footways beside a street may look like it; where they differ in width the middle of all isn't the street's. 0 where
    not both are seen, or where they lie so far apart that one of them has slipped.
    """
    distance = np.abs(view.offsets - band.offsets)
    return np.where(np.isfinite(distance) & (distance <= APART), distance, 0.0)


def _pavement_beside(layout: RoadLayout) -> float:
    """Return the distance, m, of the middle of all strips of pavement from the middle of a road's two carriageways.

    With a third carriageway beside them all is symmetric about another axis than the road's.
    """
    spans = paved_spans(layout.pavement)
    if layout.kind == "single" or not spans:
        return 0.0
    beyond_right = max(0.0, layout.bands[0].low - min(right for right, _ in spans))
    beyond_left = max(0.0, max(left for _, left in spans) - layout.bands[-1].high)
    return 0.5 * abs(beyond_left - beyond_right)


def _unevenness(layout: RoadLayout) -> Float:
    """Return the distance (K,), m, of the middle of all pavement from the middle between two carriageways.

    Where one carriageway has more lanes than the other the axis of symmetry is not the road's axis. 0 where not all
    edges are seen, and of a single carriageway.
    """
    if layout.kind == "single":
        return np.zeros(len(layout.bands[0].edges[0].measured))
    right_width, left_width = (edges[1].measured - edges[0].measured for edges in (band.edges for band in layout.bands))
    both_seen = np.isfinite(right_width) & np.isfinite(left_width)
    return (
        np.asarray(np.abs(0.5 * (fill_gaps(left_width) - fill_gaps(right_width))))
        if both_seen.any()
        else np.zeros(len(both_seen))
    )
