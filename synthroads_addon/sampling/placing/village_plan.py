"""Villages from a seed: where they lie on the road, and how their street sides are laid out.

Crossing and bus stops take their places first. Then each side is divided into plots, each with a drive where the kerb
is lowered, and parking bays lie in what is left between drives.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
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
NARROWEST_LANE = 2.75
"""Lanes between which there may be a traffic island are at least so wide, m. Chosen."""
BESIDE_ISLAND = 0.25
"""Strip of pavement between a traffic island and a lane, m. Chosen."""
SHELTER_ROOM = 5.0
"""Length of the road along which a bus shelter stands in place of plots, m. Chosen."""
STAND_LENGTH = 5.8
"""Length of a stand parallel to the road, m: 5 to 6.7 m by how a vehicle gets in."""
_BEFORE_TAPER = 1.0  # m, from the footway's transition to where lanes begin to move
_BESIDE_NOSE = 1.0  # m, before and behind an island, along which lanes are moved as beside it
_ISLAND_SHARE = 0.25  # of the village's length, which ends at where its bus stops are
_SHELTER_BEHIND = 1.0  # m, from the middle of a stop to that of its shelter
_BESIDE_RESERVED = 0.01  # m
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
class EntranceIsland:
    """A traffic island where a village begins, beside which lanes are moved outwards.

    Attributes:
        start, end: stations between which the lanes aren't where they usually are, m.
        first, last: stations between which they are moved by as much as they are at most, m.
        shifts: by how much each side's lane is moved, m.
        width, length: of the island, m; it lies in the middle of both lengths.
    """

    start: float
    end: float
    first: float
    last: float
    shifts: dict[Side, float]
    width: float
    length: float


@dataclass(frozen=True)
class Village:
    """A village on the road.

    Attributes:
        start, end: stations, m.
        streets: its street sides.
        plots: the plots along either side.
        crossing: station of its zebra crossing, m; None for none.
        stops: stations of the bus stops by side, m.
        shelters: stations of the middles of the bus stops' shelters by side, m.
        islands: traffic islands at its ends.
    """

    start: float
    end: float
    streets: dict[Side, StreetSide]
    plots: dict[Side, list[Plot]]
    crossing: float | None
    stops: dict[Side, float]
    shelters: dict[Side, float] = field(default_factory=dict)
    islands: tuple[EntranceIsland, ...] = ()

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
    islands = tuple(_islands(scenario, seed, (start, end), transition, carriageways))
    shelters = {
        side: round_value(station + carriageways[side].traffic * _SHELTER_BEHIND)
        for side, station in stops.items()
        if stream(seed, "villages", "shelter", side).random() < limits.shelters
    }
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
        for island in islands:
            taken.add(island.start, island.end)
        no_houses = Reservations((island.start, island.end) for island in islands)
        if side in shelters:
            no_houses.add(shelters[side] - SHELTER_ROOM / 2.0, shelters[side] + SHELTER_ROOM / 2.0)
        plots[side], drives = _plots(scenario, side_rng, span, taken, no_houses)
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
    return (Village(start, end, streets, plots, crossing, stops, shelters, islands),)


def _islands(
    scenario: RoadScenario,
    seed: int,
    span: tuple[float, float],
    transition: float,
    carriageways: dict[Side, Carriageway],
) -> Iterator[EntranceIsland]:
    """Yield the traffic islands at the ends of a village between two stations (m), which leave its middle free.

    None is where lanes are narrower than `NARROWEST_LANE`, and where the country has no sign for them.
    """
    limits, length = scenario.villages, span[1] - span[0]
    lanes = [nominal_width(lane.width) for item in carriageways.values() for lane in item.lanes]
    has_sign = "island" in GUIDELINE_OF_CLASS[scenario.design_class].sign_roles
    if not limits.islands or len(carriageways) < 2 or min(lanes) < NARROWEST_LANE or not has_sign:
        return
    for at_end in (False, True):
        rng = stream(seed, "villages", "island", int(at_end))
        is_drawn, is_one_sided = rng.random() < limits.islands, rng.random() < limits.one_sided_islands
        width, island_length = draw(rng, limits.island_width), draw(rng, limits.island_length)
        taper_per_metre = draw(rng, limits.island_taper)
        room = width + 2.0 * BESIDE_ISLAND
        # Traffic that leads in goes with the stations at the beginning, and against them at the end.
        leading_in = next(side for side, item in carriageways.items() if (item.traffic > 0) != at_end)
        shifts = dict.fromkeys(carriageways, room / 2.0)
        if is_one_sided:
            shifts = {side: room if side == leading_in else 0.0 for side in carriageways}
        taper = max(shifts.values()) * taper_per_metre
        full = island_length + 2.0 * _BESIDE_NOSE
        if not is_drawn or transition + _BEFORE_TAPER + 2.0 * taper + full > _ISLAND_SHARE * length - RAISED_LENGTH:
            continue
        begin, sign = (span[1], -1.0) if at_end else (span[0], 1.0)
        distances = np.cumsum([transition + _BEFORE_TAPER, taper, full, taper])
        stations = [round_value(begin + sign * distance) for distance in distances.tolist()]
        start, first, last, end = sorted(stations)
        yield EntranceIsland(
            start, end, first, last, {s: round_value(v) for s, v in shifts.items()}, width, island_length
        )


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
    scenario: RoadScenario,
    rng: np.random.Generator,
    span: tuple[float, float],
    taken: Reservations,
    no_houses: Reservations,
) -> tuple[list[Plot], list[KerbLevel]]:
    """Return the plots of a side between two stations (m), and the kerb's levels at drives, which are reserved.

    Args:
        scenario: limits.
        rng: random generator.
        span: stations of the side's beginning and end, m.
        taken: where no drive may be; those of the plots are added.
        no_houses: where no plot may be.
    """
    plots: list[Plot] = []
    drives: list[KerbLevel] = []
    station = span[0]
    while True:
        length, drive_length = draw(rng, scenario.villages.plot_length), draw_between(rng, _DRIVE)
        while blocked := no_houses.within(station, station + length):
            station = blocked[-1][1] + _BESIDE_RESERVED
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
