"""Where road furniture stands: guardrails and delineators by the safety rules."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .limits import DELINEATOR_SPACING
from .model import Carriageway, Delineator, Guardrail, HorizontalElement, Terrain

GUARDRAIL_DISTANCE = 0.70
"""From the paved edge to the posts' axis: the beam's face then stands 0.5 m from the pavement (m)."""
DELINEATOR_DISTANCE = 0.50
"""From the paved edge to the delineator's axis where there is no guardrail (m)."""
DELINEATOR_BEHIND_GUARDRAIL = 1.15
"""From the paved edge to the delineator's axis where a guardrail stands in front of it (m)."""
SHORTEST_GUARDRAIL = 60.0


def paved_edge(carriageway: Carriageway) -> float:
    """Return the distance of the outer paved edge from the centreline, m."""
    return carriageway.inner_offset + carriageway.paved_width


def roadside_guardrail(carriageway: Carriageway, start: float, end: float, through: bool, instance: int) -> Guardrail:
    """Return the guardrail beside one carriageway, its beam towards the traffic.

    One that stands all along the road goes on beyond both ends, so it has no terminals.
    """
    return Guardrail(
        instance=instance,
        start_station=start,
        end_station=end,
        offset=carriageway.sign * (paved_edge(carriageway) + GUARDRAIL_DISTANCE),
        faces="right" if carriageway.side == "left" else "left",
        terminal_length=0.0 if through else min(12.0, (end - start) / 4),
    )


def needs_guardrail(terrain: Terrain) -> bool:
    """Return whether the embankment is so high and steep that a guardrail must stand all along it (RPS)."""
    return terrain.embankment_height > 3.0 and terrain.batter_slope < 3.0


def median_guardrail(length: float, instance: int) -> Guardrail:
    """Return the double-sided guardrail on the centreline; it goes on beyond both ends, so it has no terminals."""
    return Guardrail(
        instance=instance, start_station=0.0, end_station=length, offset=0.0, faces="both", terminal_length=0.0
    )


def delineators(
    carriageway: Carriageway, stations: NDArray[np.float64], guardrails: list[Guardrail], first_instance: int
) -> Iterator[tuple[str, Delineator]]:
    """Yield (id, post) at stations (P,) along the outer edge of one carriageway, behind the guardrail where one is."""
    for index, station in enumerate(stations):
        offset = carriageway.sign * (paved_edge(carriageway) + DELINEATOR_DISTANCE)
        covered = any(
            rail.start_station <= station <= rail.end_station and rail.offset * offset > 0 for rail in guardrails
        )
        if covered:
            offset = carriageway.sign * (paved_edge(carriageway) + DELINEATOR_BEHIND_GUARDRAIL)
        yield (
            f"delineator-{carriageway.side}-{index + 1:04d}",
            Delineator(
                instance=first_instance + index,
                station=float(station),
                offset=offset,
                rotation_deg=180.0 if carriageway.side == "left" else 0.0,
            ),
        )


def delineator_stations(elements: tuple[HorizontalElement, ...]) -> NDArray[np.float64]:
    """Return stations of delineators, from half a spacing after the beginning to the end.

    Between two posts lies the spacing of the table at the tightest curvature within the next 50 m, so that the posts
    come closer before a curve begins.
    """
    radii, spacings = np.array(DELINEATOR_SPACING).T
    borders = np.cumsum([0.0, *(element.length for element in elements)])
    # Curvature is linear in between, so that its largest values stand at borders and at the ends of the stretch ahead.
    at_border = np.abs([*(element.curvature_start for element in elements), elements[-1].curvature_end])
    at_border = np.maximum(at_border, np.abs([elements[0].curvature_start, *(e.curvature_end for e in elements)]))

    def spacing(station: float) -> float:
        ends = np.interp([station, station + 50.0], borders, at_border)
        ahead = max(*ends, at_border[(borders >= station) & (borders <= station + 50.0)].max(initial=0.0))
        return float(np.interp(1.0 / max(ahead, 1e-9), radii, spacings))

    length = float(borders[-1])
    result, station = [], min(spacing(0.0), length) / 2.0
    while station <= length:
        result.append(station)
        station += spacing(station)
    return np.array(result)
