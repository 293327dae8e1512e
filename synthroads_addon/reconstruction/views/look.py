"""All views of one road's axis, and what they agree on."""

from collections.abc import Sequence

import numpy as np

from ..layout import FoundAxis, RoadLayout, axis_from_lines
from ..profiles import Profiles
from .extent import view_extent
from .fusion import FusedAxis, fuse
from .markings import view_lines
from .pavement import view_brightness
from .period import view_period
from .skeleton import view_skeleton
from .symmetry import view_symmetry
from .view import View


def find_fused_axis(profiles: Profiles, layout: RoadLayout, others: Sequence[View] = ()) -> FusedAxis:
    """Return the axis that all views of profiles, and others given (a network's), agree on.

    Args:
        profiles: along a path parallel to the road.
        layout: that these profiles show.
        others: further views in the profiles' stretches.
    """
    lines = axis_from_lines(layout)
    return fuse(profiles.middles, [*rule_views(profiles, layout, lines), *others])


def rule_views(profiles: Profiles, layout: RoadLayout, lines: FoundAxis) -> list[View]:
    """Return the views that learn nothing: lines, marking period, brightness, dark skeleton, cross-profile, extent."""
    dual = layout.kind == "dual"
    cores = [0.5 * (band.low + band.high) for band in layout.bands]
    level = float(np.median(lines.offsets))
    return [
        view_lines(profiles, layout, lines),
        view_period(profiles, dual, level),
        view_brightness(profiles, cores, dual),
        view_skeleton(profiles, cores),
        view_symmetry(profiles),
        view_extent(profiles),
    ]
