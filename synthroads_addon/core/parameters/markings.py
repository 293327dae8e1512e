"""Line markings derived from the cross-section (RMS A)."""

from __future__ import annotations

from collections.abc import Iterator

from .model import Carriageway, LineMarking

NARROW, BROAD = 0.15, 0.30
LANE_DASH, LANE_GAP = 6.0, 12.0


def line_markings(
    name: str, carriageway: Carriageway, length: float, first_instance: int
) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, marking) of one carriageway: edge lines solid, lane lines 6 m dashed with gaps of 12 m."""
    count = len(carriageway.lanes)
    for boundary in range(count + 1):
        kind = "outer_edge" if boundary == 0 else "inner_edge" if boundary == count else "lane"
        lane_line = kind == "lane"
        yield (
            f"{name}-line-{boundary}",
            LineMarking(
                instance=first_instance + boundary,
                carriageway=name,
                kind=kind,
                boundary=boundary,
                width=BROAD if kind == "outer_edge" else NARROW,
                dash_length=LANE_DASH if lane_line else 0.0,
                gap_length=LANE_GAP if lane_line else 0.0,
                start_station=0.0,
                end_station=length,
            ),
        )
