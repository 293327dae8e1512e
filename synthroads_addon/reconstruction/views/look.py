"""All views of one road's axis, and what they agree on."""

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Float
from ..layout import FoundAxis, RoadLayout, axis_from_lines
from ..smoothing import fill_gaps
from .extent import view_extent
from .fusion import FusedAxis, fuse
from .markings import view_lines
from .pavement import view_brightness
from .period import view_period
from .skeleton import view_skeleton
from .symmetry import view_symmetry
from .view import View


def find_fused_axis(layout: RoadLayout, others: Sequence[View] = ()) -> FusedAxis:
    """Return the axis that all views of profiles, and others given (a network's), agree on.

    Args:
        layout: that profiles along a path parallel to the road show.
        others: further views in the profiles' stretches.
    """
    lines = axis_from_lines(layout)
    return fuse(layout.profiles.middles, [*rule_views(layout, lines), *others])


def rule_views(layout: RoadLayout, lines: FoundAxis) -> list[View]:
    """Return the views that learn nothing: lines, marking period, brightness, dark skeleton, cross-profile, extent."""
    profiles, dual = layout.profiles, layout.kind == "dual"
    cores = [0.5 * (band.low + band.high) for band in layout.bands]
    level = float(np.median(lines.offsets))
    uneven = _unevenness(layout)
    return [
        view_lines(layout, lines),
        view_period(profiles, dual, level),
        view_brightness(profiles, cores, dual),
        view_skeleton(profiles, cores).less_sure(0.5 * uneven),
        view_symmetry(profiles).less_sure(uneven),
        view_extent(profiles),
    ]


def _unevenness(layout: RoadLayout) -> Float:
    """Return how far (K,), m, the middle of all pavement lies beside the middle between two carriageways.

    Where one has more lanes than the other, what is the same to both sides is not the road's axis. 0 where not all
    edges are seen, and of a single carriageway.
    """
    if layout.kind == "single":
        return np.zeros(len(layout.bands[0].edges[0].measured))
    right, left = (edges[1].measured - edges[0].measured for edges in (band.edges for band in layout.bands))
    known = np.isfinite(right) & np.isfinite(left)
    return np.asarray(np.abs(0.5 * (fill_gaps(left) - fill_gaps(right)))) if known.any() else np.zeros(len(known))
