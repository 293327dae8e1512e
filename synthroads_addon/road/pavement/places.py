"""Stations and offsets of a carriageway as places on its pavement: in which lane, how far from its middle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Float
from ..section_geometry import CarriagewaySection
from ..turnout_geometry import TURNOUT_STRIPS
from .field import BAY, LANE, SHOULDER, PavementPlace, place_code


def strip_lanes(kinds: tuple[str, ...], lanes: int) -> list[tuple[int, int]]:
    """Return of each strip the kind that its places have, and the strip that their lane's middle is taken of.

    Edge strips were paved with the lane beside them, and belong to it.

    Args:
        kinds: of the strips, innermost first, as `CarriagewaySection.kinds` has them.
        lanes: number of lanes.
    """
    first_lane = kinds.index("lane")
    last_lane = first_lane + lanes - 1
    kind_codes = {"hard_shoulder": SHOULDER} | {kind: BAY + number for number, kind in enumerate(TURNOUT_STRIPS)}
    codes_and_lanes = []
    for number, kind in enumerate(kinds):
        lane = min(max(number, first_lane), last_lane)
        is_lane_pavement = kind in ("lane", "inner_edge_strip", "outer_edge_strip")
        codes_and_lanes.append(
            (LANE + last_lane - lane, lane) if is_lane_pavement else (kind_codes.get(kind, SHOULDER), number)
        )
    return codes_and_lanes


def pavement_places(
    section: CarriagewaySection, station: Float, offset: Float, contrasts: Sequence[float] = ()
) -> PavementPlace:
    """Return the places (N,) of stations and offsets (N,) on a carriageway.

    Args:
        section: the carriageway's.
        station, offset: m.
        contrasts: of its strips, see `age.strip_contrasts`; none where nothing but heights is asked.
    """
    distance, constant_distances = section.carriageway.sign * offset, section.constant_distances
    lanes = np.array(strip_lanes(section.kinds, len(section.carriageway.lanes))).T
    if constant_distances is not None:
        strip = np.minimum(np.searchsorted(constant_distances[1:], distance, side="right"), len(section.kinds) - 1)
        kind, source = (np.take(row, strip) for row in lanes)
        inner, outer = np.take(constant_distances, source), np.take(constant_distances, source + 1)
    else:
        distances = section.distances(station)
        strip = np.clip((distances[:, 1:] <= distance[:, None]).sum(axis=1), 0, len(section.kinds) - 1)
        kind, source = (np.take(row, strip) for row in lanes)
        rows = np.arange(len(distance))
        inner, outer = distances[rows, source], distances[rows, source + 1]
    code = place_code(kind, int(section.carriageway.side == "left"), (outer - inner) / 2.0)
    age = np.array(contrasts)[strip] if len(contrasts) else np.zeros(len(distance))
    return PavementPlace(np.asarray(station, np.float64), distance - (inner + outer) / 2.0, code, age)
