"""Rules for what stands beside the road: guardrails (RPS), delineators, plants, and objects off the road."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from .checker_base import TOLERANCE, Finding, Float, Road, Rule, above, below, gaps
from .limits import DELINEATOR_SPACING
from .model import Carriageway, Guardrail, Vegetation

#: An embankment higher (m) and steeper (run per height) than this needs guardrails (RPS).
EMBANKMENT_HEIGHT, EMBANKMENT_RUN = 3.0, 3.0
#: From the paved edge to a guardrail's nearest part, and to a delineator's axis, m (RPS).
FACE_DISTANCE = 0.5
DELINEATOR_DISTANCE = 0.5
#: From the posts' axis to the face of a beam, and to the posts' rear, m.
BEAM_REACH, POST_REACH = 0.2, 0.05
#: Shortest guardrail, m (RPS).
SHORTEST_GUARDRAIL = 60.0
#: From the paved edge to the nearest unprotected tree, m (RPS: obstacles on level ground).
TREE_DISTANCE = {"EKA1A": 12.0, "EKA1B": 12.0, "EKA2": 12.0, "EKA3": 7.5}
#: Delineators may stand this much (m) farther apart: stations are rounded.
SPACING_ROOM = 1e-3

_FACES: dict[int, Literal["left", "right"]] = {1: "left", -1: "right"}


def _outer_edge(carriageway: Carriageway) -> float:
    """Return the distance of the outer paved edge from the centreline, m."""
    return carriageway.inner_offset + carriageway.paved_width


def _clearance(road: Road, low: float, high: float) -> float:
    """Return the distance (m) of what lies between two offsets from the nearest pavement; negative over it."""
    distances = []
    for carriageway in road.carriageways.values():
        edges = sorted((carriageway.sign * carriageway.inner_offset, carriageway.sign * _outer_edge(carriageway)))
        distances.append(max(edges[0] - high, low - edges[1]))
    return min(distances)


def _rail_clearance(road: Road, rail: Guardrail) -> float:
    left = BEAM_REACH if rail.faces in ("left", "both") else POST_REACH
    right = BEAM_REACH if rail.faces in ("right", "both") else POST_REACH
    return _clearance(road, rail.offset - right, rail.offset + left)


def _outer_rails(road: Road, carriageway: Carriageway, reach: float = np.inf) -> list[tuple[float, float]]:
    """Return the stretches (m) of guardrails outside a carriageway that face it, within `reach` of its edge."""
    sign, edge = carriageway.sign, _outer_edge(carriageway)
    return [
        (rail.start_station, rail.end_station)
        for rail in road.guardrails.values()
        if 0.0 < sign * rail.offset - edge < reach and rail.faces in ("both", _FACES[-sign])
    ]


def _median_guardrail(road: Road) -> Iterator[Finding]:
    if len(road.carriageways) < 2:
        return
    inner = {carriageway.sign: carriageway.inner_offset for carriageway in road.carriageways.values()}
    in_median = [rail for rail in road.guardrails.values() if -inner[-1] <= rail.offset <= inner[1]]
    for name, carriageway in road.carriageways.items():
        faces = ("both", _FACES[carriageway.sign])
        spans = [(rail.start_station, rail.end_station) for rail in in_median if rail.faces in faces]
        for start, end in gaps(spans, road.length):
            text = f"The median has no guardrail towards this carriageway for {end - start:.1f} m (RPS)."
            yield Finding(name, start, end - start, 0.0, text)


def _embankment_guardrail(road: Road) -> Iterator[Finding]:
    terrain = road.parameters.terrain
    if terrain is None or not above(terrain.embankment_height, EMBANKMENT_HEIGHT):
        return
    if not below(terrain.batter_slope, EMBANKMENT_RUN):
        return
    for name, carriageway in road.carriageways.items():
        for start, end in gaps(_outer_rails(road, carriageway), road.length):
            text = (
                f"The embankment is {terrain.embankment_height:.1f} m high and 1 : {terrain.batter_slope:g} steep, and "
                f"{end - start:.1f} m beside it are without guardrail (RPS)."
            )
            yield Finding(name, start, end - start, 0.0, text)


def _guardrail_distance(road: Road) -> Iterator[Finding]:
    for name, rail in road.guardrails.items():
        distance = _rail_clearance(road, rail)
        if distance >= 0.0 and below(distance, FACE_DISTANCE):
            text = f"The guardrail stands {distance:.2f} m from the paved edge; {FACE_DISTANCE} m are needed (RPS)."
            yield Finding(name, rail.start_station, distance, FACE_DISTANCE, text)


def _guardrail_length(road: Road) -> Iterator[Finding]:
    for name, rail in road.guardrails.items():
        length = rail.end_station - rail.start_station
        through = not list(gaps([(rail.start_station, rail.end_station)], road.length))
        if below(length, SHORTEST_GUARDRAIL) and not through:
            text = f"The guardrail is {length:.1f} m long; {SHORTEST_GUARDRAIL:.0f} m are needed (RPS)."
            yield Finding(name, rail.start_station, length, SHORTEST_GUARDRAIL, text)


def _posts(road: Road, carriageway: Carriageway) -> Float:
    """Return the sorted stations of the delineators on a carriageway's outer side, m."""
    middle = carriageway.inner_offset + carriageway.paved_width / 2.0
    return np.sort([p.station for p in road.delineators.values() if carriageway.sign * p.offset > middle])


def _spacing(road: Road, borders: Float) -> Float:
    """Return the largest spacing (m) allowed between each two of N stations, by the tightest curvature between them."""
    stations = np.concatenate((road.starts[:-1], road.starts[1:]))
    curvature = np.abs(np.concatenate((road.k0, road.k1)))
    element = np.clip(np.searchsorted(road.starts, borders, side="right") - 1, 0, len(road.lengths) - 1)
    share = (borders - road.starts[element]) / np.where(road.lengths[element] > 0.0, road.lengths[element], 1.0)
    share = np.clip(share, 0.0, 1.0)
    at = np.abs(road.k0[element] * (1.0 - share) + road.k1[element] * share)
    tightest = np.maximum(at[:-1], at[1:])
    inside = (stations > borders[0]) & (stations < borders[-1])
    np.maximum.at(tightest, np.searchsorted(borders, stations[inside], side="left") - 1, curvature[inside])
    radii, spacings = np.array(DELINEATOR_SPACING).T
    return np.interp(1.0 / np.maximum(tightest, 1e-9), radii, spacings)


def _delineator_missing(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        posts = _posts(road, carriageway)
        first = float(posts[0]) if len(posts) else road.length
        limit = float(_spacing(road, np.array([0.0, max(first, 0.0)]))[0]) / 2.0
        if first > limit + SPACING_ROOM:
            what = f"The first delineator stands at {first:.1f} m" if len(posts) else "There is no delineator"
            text = f"{what} on the outer side; one is needed within {limit:.1f} m of the beginning (HLB)."
            yield Finding(name, 0.0, first, limit, text)


def _delineator_spacing(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        posts = _posts(road, carriageway)
        if not len(posts):
            continue
        borders = np.append(posts, max(road.length, posts[-1]))
        gap, limit = np.diff(borders), _spacing(road, borders)
        for i in np.flatnonzero(gap > limit + SPACING_ROOM).tolist():
            text = f"No delineator follows for {gap[i]:.1f} m; {limit[i]:.1f} m are allowed (HLB)."
            yield Finding(name, float(posts[i]), float(gap[i]), float(limit[i]), text)


def _delineator_distance(road: Road) -> Iterator[Finding]:
    for name, post in road.delineators.items():
        distance = _clearance(road, post.offset, post.offset)
        if distance >= 0.0 and below(distance, DELINEATOR_DISTANCE):
            text = (
                f"The delineator stands {distance:.2f} m from the paved edge; {DELINEATOR_DISTANCE} m are needed (HLB)."
            )
            yield Finding(name, post.station, distance, DELINEATOR_DISTANCE, text)


def _object_range(road: Road) -> Iterator[Finding]:
    spans = [(name, line.start_station, line.end_station) for name, line in road.markings.items()]
    spans += [(name, rail.start_station, rail.end_station) for name, rail in road.guardrails.items()]
    spans += [(name, post.station, post.station) for name, post in road.delineators.items()]
    for name, start, end in spans:
        if end < start:
            yield Finding(name, end, end, start, f"The object ends at {end:.3f} m before it begins at {start:.3f} m.")
        elif max(start, end) > road.length * (1.0 + TOLERANCE):
            text = f"The object reaches {end:.3f} m; the road ends at {road.length:.3f} m."
            yield Finding(name, end, end, road.length, text)


def _object_on_pavement(road: Road) -> Iterator[Finding]:
    found = [(n, rail.start_station, _rail_clearance(road, rail)) for n, rail in road.guardrails.items()]
    found += [(n, p.station, _clearance(road, p.offset, p.offset)) for n, p in road.delineators.items()]
    for name, plants in road.parameters.of_type(Vegetation).items():
        verge = min(carriageway.verge_width for carriageway in road.carriageways.values())
        if plants.density > 0.0:
            found.append((name, 0.0, verge + plants.band_start))
    for name, station, distance in found:
        if distance < -TOLERANCE:
            yield Finding(name, station, distance, 0.0, f"The object reaches {-distance:.2f} m over the pavement.")


def _tree_distance(road: Road) -> Iterator[Finding]:
    least = TREE_DISTANCE[road.design_class]
    for name, plants in road.parameters.of_type(Vegetation).items():
        if plants.kind != "tree" or plants.density == 0.0:
            continue
        for carriageway in road.carriageways.values():
            distance = carriageway.verge_width + plants.band_start
            if distance < 0.0 or not below(distance, least):
                continue
            for start, _ in list(gaps(_outer_rails(road, carriageway, reach=distance), road.length))[:1]:
                text = (
                    f"Trees stand {distance:.2f} m from the {carriageway.side} paved edge with no guardrail in front; "
                    f"{least} m are needed (RPS)."
                )
                yield Finding(name, start, distance, least, text)


RULES = (
    Rule("median-guardrail", "The median has a guardrail throughout", "m", "RPS", "confirmed", _median_guardrail),
    Rule("embankment-guardrail", "Embankments have guardrails", "m", "RPS", "unconfirmed", _embankment_guardrail),
    Rule("guardrail-distance", "Guardrails keep clear of the pavement", "m", "RPS", "unconfirmed", _guardrail_distance),
    Rule("guardrail-length", "Shortest guardrail", "m", "RPS", "unconfirmed", _guardrail_length),
    Rule("delineator-missing", "Delineators begin at the beginning", "m", "HLB", "derived", _delineator_missing),
    Rule("delineator-spacing", "Spacing of delineators", "m", "HLB", "confirmed", _delineator_spacing),
    Rule("delineator-distance", "Delineators keep off the pavement", "m", "HLB", "confirmed", _delineator_distance),
    Rule("object-range", "Objects lie on the road's length", "m", "", "definition", _object_range),
    Rule("object-on-pavement", "Nothing stands on the pavement", "m", "", "definition", _object_on_pavement),
    Rule("tree-distance", "Trees keep clear of the pavement", "m", "RPS", "unconfirmed", _tree_distance),
)
