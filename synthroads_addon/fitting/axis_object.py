"""A measured centreline as the alignment of a parameter set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..base.errors import InputError
from ..base.schema import round_value
from ..road.parameters import AlignmentObject, HorizontalElement, VerticalPoint
from ..scenario.road import RoadScenario
from .fit import AxisFit, fit_axis, read_axis

_FLATTEST = 1e7
"""A rounding of a larger radius (m) bends by less than a millimetre over a hundred metres: it is written as a kink."""
_PLAY = 1e-5  # of a radius: roundings that touch must not overlap once stations and elevations are rounded


def alignment_object(fit: AxisFit) -> AlignmentObject:
    """Return a fitted axis as the alignment of a parameter set, with the instance number 1.

    Raises:
        InputError: what was fitted is no road: its bends, lengths or elevations are beyond all limits.
    """
    try:
        return _alignment_object(fit)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        field, wrong = fault["loc"][0] if fault["loc"] else "axis", str(fault["msg"]).lower()
        raise InputError(f"axis: {field}", fault.get("input"), f"no road runs through its points ({wrong})") from None


def _alignment_object(fit: AxisFit) -> AlignmentObject:
    start, heading, _ = fit.alignment.frame(0.0)
    return AlignmentObject(
        instance=1,
        start_x=round_value(float(start[0])),
        start_y=round_value(float(start[1])),
        start_heading_deg=round_value(float(np.rad2deg(np.angle(np.exp(1j * heading)))), 12),
        horizontal=tuple(
            HorizontalElement.between(round_value(e.length), e.curvature_start, e.curvature_end)
            for e in fit.alignment.elements
        ),
        vertical=tuple(
            VerticalPoint(
                station=round_value(p.station), elevation=round_value(p.elevation), radius=_written_radius(p.radius)
            )
            for p in fit.profile.points
        ),
    )


def _written_radius(radius: float) -> float:
    """Return the radius of a rounding as it is written."""
    return radius * (1.0 - _PLAY) if radius < _FLATTEST else 0.0


def fitted_axis(path: Path, scenario: RoadScenario) -> tuple[AlignmentObject, RoadScenario, dict[str, Any]]:
    """Fit an alignment to the points of a CSV or GeoJSON file.

    Returns:
        the alignment in local coordinates, the scenario with the length and map origin that follow from it, and how
        well it fits (m): root mean square, 95th percentile and worst distance, horizontally and in height.

    Raises:
        InputError: the file is missing or not an axis.
    """
    points = read_axis(path)
    origin = np.round(points.mean(axis=0))
    fit = fit_axis(points - origin)
    alignment = alignment_object(fit)
    road = scenario.model_copy(update={"length": alignment.length, "map_origin": tuple(origin.tolist())})
    report = {
        "file": path.name,
        "points": fit.points,
        "elements": len(alignment.horizontal),
        "horizontal": fit.horizontal.to_dict(),
        "height": fit.height.to_dict(),
    }
    return alignment, road, report
