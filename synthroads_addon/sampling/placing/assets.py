"""Free assets of the scenario's libraries, placed by their rules beside the road or in the median."""

from collections.abc import Iterator

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.schema import round_value
from ...road.section_geometry import CarriagewaySection
from ...road.things.asset import Asset
from ...road.things.limits import Interval
from ...scenario.assets import FARTHEST, AssetPlacement, read_asset_library
from .site import PlacementSite


def sample_assets(site: PlacementSite) -> Iterator[tuple[str, Asset]]:
    """Yield (id, asset) of the scenario's libraries, placed by their rules; their instance numbers are 1.

    Where the road leaves no room for one, there is none.

    Raises:
        InputError: a library is faulty, or the road leaves no room for an asset anywhere.
    """
    count = 0
    for number, path in enumerate(site.scenario.assets):
        for name, asset in read_asset_library(path).assets.items():
            field = f"{path}: assets.{name}.placement.distance"
            for station, offset, rotation in _places(site, asset.placement, field, ("assets", number, name)):
                count += 1
                item = Asset(
                    instance=1,
                    station=round_value(station),
                    offset=round_value(offset),
                    rotation_deg=round_value(rotation),
                    library=path,
                    name=name,
                    class_name=asset.class_name,
                    scale=asset.scale,
                    twin_types=asset.twin_types,
                )
                yield f"asset-{count}", item


def _places(
    site: PlacementSite, placement: AssetPlacement, field: str, purpose: tuple[str | int, ...]
) -> Iterator[tuple[float, float, float]]:
    """Yield station (m), offset (m) and rotation (deg) of an asset's copies; in the median each takes either half."""
    in_median = placement.side == "median"
    sides = [side for side in site.sections if in_median or placement.side in (side, "both")]
    for group in [sides] if in_median else [[side] for side in sides]:
        rng = site.stream(*purpose, *group)
        stations = _stations(rng, placement, site.length)
        half_number = rng.integers(len(group), size=len(stations))
        for number, side in enumerate(group):
            section, stations_here = site.sections[side], stations[half_number == number]
            edge, room = _room(site, section, in_median, stations_here, field, placement.distance.minimum)
            distance = _draw_places(
                rng, placement.distance, len(stations_here), np.minimum(placement.distance.maximum, room)
            )
            axis_distance = edge - distance if in_median else edge + distance
            rotation = _draw_places(rng, placement.rotation_deg, len(stations_here), placement.rotation_deg.maximum)
            rotation += 0.0 if section.carriageway.traffic > 0 else 180.0
            fits = room >= placement.distance.minimum
            offset = section.carriageway.sign * axis_distance
            yield from zip(stations_here[fits], offset[fits], ((rotation + 180.0) % 360.0 - 180.0)[fits], strict=True)


def _draw_places(rng: np.random.Generator, limits: Interval, count: int, maximum: Float | float) -> Float:
    """Return numbers (count,) drawn uniformly from an interval's minimum to a maximum, which may be one for each."""
    return limits.minimum + (maximum - limits.minimum) * rng.random(count)


def _stations(rng: np.random.Generator, placement: AssetPlacement, length: float) -> Float:
    """Return the drawn stations (N,) of an asset's copies along one side, m."""
    start = placement.start_station
    end = length if placement.end_station is None else min(placement.end_station, length)
    if end <= start:
        return np.empty(0)
    if placement.per_km is not None:
        per_km = float(_draw_places(rng, placement.per_km, 1, placement.per_km.maximum)[0])
        return np.sort(rng.uniform(start, end, int(per_km * (end - start) / 1000.0 + rng.random())))
    assert placement.spacing is not None
    count = int((end - start) / placement.spacing.minimum) + 1
    steps = _draw_places(rng, placement.spacing, count, placement.spacing.maximum)
    steps[0] *= rng.random()  # the first stands anywhere within a spacing
    stations = start + np.cumsum(steps)
    return stations[stations <= end]


def _room(
    site: PlacementSite,
    section: CarriagewaySection,
    in_median: bool,
    stations: Float,
    field: str,
    needed_distance: float,
) -> tuple[Float, Float]:
    """Return the distances (N,) of the edge that an asset's distance counts from, and the room (N,) beyond it, m."""

    def beside(places: Float) -> tuple[Float, Float]:
        """Return, at places along the road, the distance of the edge from the axis and the room behind it, m."""
        if in_median:
            inner = section.distances(places)[:, 0]
            return inner, inner
        edge = section.road_edge(places)
        return edge, min(site.terrain.half_width, FARTHEST) - edge

    widest_room = float(beside(np.array([0.0, *section.kinks(), site.length]))[1].max())
    if widest_room < needed_distance:
        area = "in this half of the median" if in_median else "between the verge and road.half_width"
        raise InputError(field, needed_distance, f"there are at most {max(widest_room, 0.0):g} m {area}")
    return beside(stations)
