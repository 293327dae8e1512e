"""Villages from a seed: where they lie on the road, and how their street sides are laid out.

Crossing and bus stops take their places first. Then each side is divided into plots, each with a drive where the kerb
is lowered, and parking bays lie in what is left between drives.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.random_streams import stream
from ...base.schema import round_value
from ...road.guidelines import GUIDELINE_OF_CLASS, LIMITS, STANDARD_CROSS_SECTIONS, is_single
from ...road.objects import Side, nominal_width
from ...road.section import Carriageway
from ...road.streets.street_side import KerbLevel, ParkingBay, StreetSide
from ...scenario.road import RoadScenario
from .draw import draw, draw_between, pick
from .ranges import Reservations, free_ranges

MARGIN = 25.0
"""Length of the road without village at either of its ends, m. Chosen."""
SHORTEST = 50.0
"""Shortest village, m. Chosen."""
LOWERED = 0.03
"""Height of the kerb at drives and crossings, m: what people pass without a step (RASt 06, a textbook says)."""
RAISED, RAISED_LENGTH = 0.18, 12.0
"""Height and length of the kerb of a bus stop, m. Chosen, after kerbs made for low-floor buses."""
BESIDE_VILLAGE = 5.0
"""Length before and behind a village without the open road's furniture, m. Chosen."""
CROSSING_LENGTH = 4.0
"""Length of a zebra crossing along the road, m; 3 m are the least."""
STAND_LENGTH = 5.8
"""Length of a stand parallel to the road, m: 5 to 6.7 m by how a vehicle gets in."""
_TRANSITION = (3.0, 6.0)
_DRIVE = (3.0, 4.5)  # m, length of the lowered kerb
_DRIVE_BEGIN = 1.5  # m, from the plot's beginning to the ramp of its drive
_RAMP, _STOP_RAMP = 1.0, 1.5  # m
_CLEAR = 6.0  # m on either side of a crossing without drives or bays
_MOST_STANDS, _BAY_CHANCE = 5, 0.75
_FOOTWAYS = ("concrete_pavers", "concrete_pavers", "asphalt", "setts")


@dataclass(frozen=True)
class Plot:
    """A plot along the road.

    Attributes:
        start, end: stations, m.
        drive: station of the middle of its drive, m; None where it has none.
    """

    start: float
    end: float
    drive: float | None


@dataclass(frozen=True)
class Village:
    """A village on the road.

    Attributes:
        start, end: stations, m.
        streets: its street sides.
        plots: the plots along either side.
        crossing: station of its zebra crossing, m; None for none.
        stops: stations of the bus stops by side, m.
    """

    start: float
    end: float
    streets: dict[Side, StreetSide]
    plots: dict[Side, list[Plot]]
    crossing: float | None
    stops: dict[Side, float]

    def reaches(self, start: float, end: float) -> bool:
        """Return whether anything between two stations (m) lies in the village."""
        return start < self.end and end > self.start


def sample_villages(
    scenario: RoadScenario, seed: int, length: float, carriageways: dict[Side, Carriageway]
) -> tuple[Village, ...]:
    """Return the villages of a road of a length (m): none or one."""
    limits, rng = scenario.villages, stream(seed, "villages")
    room = length - 2.0 * MARGIN
    if not may_have_villages(scenario) or rng.random() >= limits.share or room < SHORTEST:
        return ()
    village_length = min(draw(rng, limits.length), room)
    start = round_value(MARGIN + (room - village_length) * rng.random())
    end = round_value(start + max(village_length, SHORTEST))
    middle = (start + end) / 2.0
    crossing = None
    if rng.random() < limits.crossing and _may_cross(scenario, carriageways):
        crossing = round_value(middle + 0.15 * (end - start) * (2.0 * rng.random() - 1.0))
    stops: dict[Side, float] = {}
    is_for_buses = _paved_width(carriageways) >= LIMITS[scenario.design_class].bus_carriageway
    for side in carriageways:
        place = middle + (0.25 if side == "right" else -0.25) * (end - start)
        if rng.random() < limits.bus_stop and is_for_buses and end - start > 120.0:
            stops[side] = round_value(place)
    transition = draw_between(rng, _TRANSITION)
    shared: dict[str, Any] = {
        "transition_length": transition,
        "gutter_rows": pick(rng, (1, 2, 2, 3)) if rng.random() < limits.gutters else 0,
        "gutter_material": pick(rng, ("setts", "setts", "concrete")),
        "kerb_height": draw(rng, limits.kerb_height),
        "kerb_width": pick(rng, (0.12, 0.15, 0.15)),
        "kerb_material": pick(rng, ("granite", "concrete")),
        "footway_material": pick(rng, _FOOTWAYS),
        "bay_material": pick(rng, ("setts", "concrete_pavers")),
    }
    streets, plots = {}, {}
    for side in carriageways:
        side_rng = stream(seed, "villages", side)
        fixed_levels = [_level(stops[side], RAISED_LENGTH, RAISED, _STOP_RAMP)] if side in stops else []
        fixed_levels += [_level(crossing, CROSSING_LENGTH, LOWERED, _RAMP)] if crossing is not None else []
        span = (start + transition, end - transition)
        taken = Reservations((level.start_station, level.end_station) for level in fixed_levels)
        if crossing is not None:
            taken.add(crossing - _CLEAR, crossing + _CLEAR)
        plots[side], drives = _plots(scenario, side_rng, span, taken)
        bay_width, footway_width = draw(side_rng, limits.bay_width), draw(side_rng, limits.footway_width)
        bays = tuple(_bays(side_rng, span, taken, bay_width)) if side_rng.random() < limits.parking else ()
        fields: dict[str, Any] = shared | {
            "footway_width": round_value(footway_width + bay_width if bays else footway_width),
            "kerb_levels": tuple(sorted([*fixed_levels, *drives], key=lambda level: level.station)),
            "bays": bays,
        }
        streets[side] = StreetSide(
            instance=1, carriageway=f"carriageway-{side}", start_station=start, end_station=end, **fields
        )
    return (Village(start, end, streets, plots, crossing, stops),)


def may_have_villages(scenario: RoadScenario) -> bool:
    """Return whether a road may lead through villages.

    It has one carriageway and at most one line in its middle.
    """
    section = scenario.cross_section
    is_narrow = isinstance(section, str) and STANDARD_CROSS_SECTIONS[section].centre_line in ("none", "single")
    return is_single(scenario.design_class) and is_narrow


def _paved_width(carriageways: dict[Side, Carriageway]) -> float:
    """Return the width of the pavement of both directions, m."""
    strips = ("inner_edge_strip_width", "outer_edge_strip_width", "hard_shoulder_width")
    widths = [getattr(item, name) for item in carriageways.values() for name in strips]
    widths += [lane.width for item in carriageways.values() for lane in item.lanes]
    return float(sum(nominal_width(width) for width in widths))


def _may_cross(scenario: RoadScenario, carriageways: dict[Side, Carriageway]) -> bool:
    """Return whether zebra crossings are allowed: where each direction has one lane and the country a sign."""
    has_sign = "crossing" in GUIDELINE_OF_CLASS[scenario.design_class].sign_roles
    return has_sign and all(len(carriageway.lanes) == 1 for carriageway in carriageways.values())


def _level(station: float, length: float, height: float, ramp: float) -> KerbLevel:
    """Return a kerb's level around a station, all m."""
    return KerbLevel(station=round_value(station), length=round_value(length), height=height, ramp_length=ramp)


def _plots(
    scenario: RoadScenario, rng: np.random.Generator, span: tuple[float, float], taken: Reservations
) -> tuple[list[Plot], list[KerbLevel]]:
    """Return the plots of a side between two stations (m), and the kerb's levels at drives, which are reserved."""
    plots: list[Plot] = []
    drives: list[KerbLevel] = []
    station = span[0]
    while True:
        length, drive_length = draw(rng, scenario.villages.plot_length), draw_between(rng, _DRIVE)
        if station + length > span[1]:
            return plots, drives
        level = _level(station + _DRIVE_BEGIN + _RAMP + drive_length / 2.0, drive_length, LOWERED, _RAMP)
        has_drive = taken.is_free(level.start_station, level.end_station)
        if has_drive:
            taken.add(level.start_station, level.end_station)
            drives.append(level)
        plots.append(Plot(round_value(station), round_value(station + length), level.station if has_drive else None))
        station += length


def _bays(
    rng: np.random.Generator, span: tuple[float, float], taken: Reservations, width: float
) -> Iterator[ParkingBay]:
    """Yield parking bays of a width (m) in the free parts of a side, each for some stands."""
    for start, end in free_ranges(span[0], span[1], taken):
        taper = 1.0
        stands = min(int((end - start - 2.0 * taper - 1.0) / STAND_LENGTH), _MOST_STANDS)
        if stands < 1 or rng.random() >= _BAY_CHANCE:
            continue
        middle, half = (start + end) / 2.0, stands * STAND_LENGTH / 2.0 + taper
        yield ParkingBay(
            start_station=round_value(middle - half),
            end_station=round_value(middle + half),
            width=width,
            taper_length=taper,
        )
