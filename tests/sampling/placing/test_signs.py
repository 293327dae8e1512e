"""Traffic signs: their catalogue, and where they stand."""

import re
from typing import Any

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.guidelines import EXIT_SEQUENCE, GORE_SIGN, StandardCrossSection
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.sign_catalogue import SignCatalogue, SignType, sign_catalogue, sign_type
from tests.helpers.roads.sites import bay_at, beside, curve, entry_at, exit_at, make_site, of, place, straight

SIGNS: dict[str, Any] = {"furniture": {"signs": True}}
URBAN: dict[str, Any] = {"design_class": "EKA3", "cross_section": "RQ25"}
EDGE = 14.0
"""Distance of the outer paved edge of an RQ 31 from the centreline, m."""


def coded(furniture: dict[str, Any], code: str) -> list[TrafficSign]:
    return [
        sign for sign in of(furniture, TrafficSign).values() if sign.code.split("-")[0] == code or sign.code == code
    ]


# --- catalogue ----------------------------------------------------------------------------------------------------


ON_ISLANDS = ("pass_left", "pass_right")
"""Pictograms of signs that stand low, on traffic islands."""
BEACON = "GB.ZEBRA"
"""The globe on the pole of a British crossing, as a disc."""


def test_the_catalogue() -> None:
    catalogue = sign_catalogue()
    assert set(EXIT_SEQUENCE.values()) | {GORE_SIGN} <= set(catalogue.signs)
    for code, sign in catalogue.signs.items():
        assert sign.class_name == "road_sign"
        assert sign.lower_edge >= 1.5 or code.startswith(("450", "625")) or sign.pictogram in ON_ISLANDS
        assert {sign.ground, sign.border, sign.writing} <= set(catalogue.colors)
        TrafficSign(instance=1, station=0.0, offset=0.0, code=code, text=sign.text, **sign.fields())
    # Codes of other countries' signs begin with the country, and a point.
    countries: dict[str, dict[str, SignType]] = {}
    for code, sign in catalogue.signs.items():
        countries.setdefault(code.split(".")[0] if "." in code else "DE", {})[code] = sign
    # British signs of 30 mph and of the end of limits are those of slow roads.
    sizes = {"DE": ({0.75}, 1.26, 1.09), "FR": ({0.85}, 1.0, 0.87), "GB": ({0.6, 0.75}, 0.9, 0.78)}
    speeds = {"DE": "30 50 60 70 80 100 120", "FR": "30 50 70 90", "GB": "30 40 50 60"}
    assert set(countries) == set(sizes)
    for country, (round_sizes, triangle_width, triangle_height) in sizes.items():
        signs = countries[country]
        rounds = [
            sign
            for code, sign in signs.items()
            if sign.shape == "round" and code not in ("224", BEACON) and sign.pictogram not in ON_ISLANDS
        ]
        triangles = {(sign.width, sign.height) for sign in signs.values() if sign.shape == "triangle"}
        assert {(sign.width, sign.height) for sign in rounds} == {(size, size) for size in round_sizes}
        assert triangles == {(triangle_width, triangle_height)}
        assert {s.text[0] for s in rounds if s.pictogram == "number"} == set(speeds[country].split())


def test_the_catalogue_is_checked() -> None:
    data = sign_catalogue().to_dict()
    assert SignCatalogue.from_dict(data) == sign_catalogue()
    data["signs"]["123"]["ground"] = "pink"
    with pytest.raises(InputError, match=r"signs.123: colour 'pink' must be one of white"):
        SignCatalogue.from_dict(data)


def test_every_sign_that_is_placed_is_in_the_catalogue() -> None:
    site = make_site(straight(2500.0), turnouts=[exit_at(1200.0)], furniture={"signs": True, "construction_zone": 1.0})
    signs = of(place(site), TrafficSign)
    assert len(signs) > 10
    for sign in signs.values():
        kind = sign_type(sign.code)
        assert kind is not None
        assert (sign.shape, sign.height, sign.posts) == (kind.shape, kind.height, kind.posts)
        assert not any("{" in line for line in sign.text)
    assert sign_type("999") is None


# --- exits and entries --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_sequence_before_an_exit(side: str) -> None:
    start = 1200.0 if side == "right" else 2500.0 - 1200.0 - 400.0
    site = make_site(straight(2500.0), turnouts=[exit_at(start, side)], **SIGNS)
    begin = 1200.0 if side == "right" else 1300.0
    furniture, ahead = place(site), 1.0 if side == "right" else -1.0
    for distance, code in EXIT_SEQUENCE.items():
        (sign,) = coded(furniture, code)
        assert sign.station == pytest.approx(begin - ahead * distance)
        assert sign.offset * ahead < -EDGE - 0.5 - sign.width / 2.0 + 1e-9
        assert sign.rotation_deg == (0.0 if side == "right" else 180.0)
    (announced,), (where,) = coded(furniture, "448"), coded(furniture, "449")
    assert announced.text[1] == where.text[1] in sign_catalogue().destinations
    assert announced.text[2] == "1000 m"
    assert {sign.text[0] for sign in coded(furniture, "450")} == {announced.text[0]}


def test_signs_that_fall_before_the_begin_are_left_out() -> None:
    furniture = place(make_site(straight(1000.0), turnouts=[exit_at(250.0)], **SIGNS))
    assert not coded(furniture, "448")
    assert not coded(furniture, "449")
    assert {sign.code for sign in coded(furniture, "450")} == {"450-50", "450-51"}


def test_signs_of_a_sequence_make_room_for_boards_that_cannot_move() -> None:
    moved = 0
    for seed in range(300):
        site = make_site(
            straight(1000.0),
            turnouts=[exit_at(510.0)],
            seed=seed,
            furniture={"signs": True, "kilometre_boards": True},
        )
        for sign in coded(place(site), "450"):
            away = abs(510.0 - sign.station - round((510.0 - sign.station) / 100.0) * 100.0)
            assert away <= 5.0
            moved += away > 1e-6
    assert moved > 0


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_exit_board_stands_in_the_middle_of_the_island(side: str) -> None:
    site = make_site(straight(1000.0), turnouts=[exit_at(300.0, side)], **SIGNS)
    (board,) = coded(place(site), GORE_SIGN)
    inner, outer = site.sections[side].boundaries_of("island", board.station)
    assert abs(board.offset) == pytest.approx(float(inner[0] + outer[0]) / 2.0)
    assert float(outer[0] - inner[0]) - board.width >= 1.0
    assert board.post_diameter <= 0.1
    assert board.rotation_deg == (0.0 if side == "right" else 180.0)
    nose = site.shape(site.turnouts["turnout-1"]).nose_station()
    assert 0.0 < (board.station - nose) * (1 if side == "right" else -1) < 40.0


def test_a_narrow_island_has_a_smaller_exit_board() -> None:
    section = StandardCrossSection((3.75, 3.75), 0.0, 0.75, 0.75, 4.0)
    site = make_site(straight(1000.0), turnouts=[exit_at(300.0, clothoid=330.0)], section=section, **SIGNS)
    (board,) = coded(place(site), GORE_SIGN)
    inner, outer = (float(edge[0]) for edge in site.sections["right"].boundaries_of("island", board.station))
    assert 0.1 < board.width < 1.25
    assert -board.offset - board.width / 2.0 - inner >= 0.5
    assert outer + board.offset - board.width / 2.0 >= 0.5


def test_distance_tables_stand_behind_entries() -> None:
    furniture = place(make_site(straight(1500.0), turnouts=[entry_at(300.0)], **SIGNS))
    (table,) = coded(furniture, "453")
    assert table.station == pytest.approx(700.0 + 250.0)
    assert re.fullmatch(r"A \d{1,2}", table.text[0])
    distances = [int(line.split()[-2]) for line in table.text[1:]]
    assert distances == sorted(distances)
    assert all(line.endswith(" km") for line in table.text[1:])
    assert not coded(place(make_site(straight(1500.0), turnouts=[bay_at(300.0)], **SIGNS)), "453")


# --- speed limits, curves, construction zones ------------------------------------------------------------------------


def test_speed_limits_on_urban_motorways() -> None:
    furniture = place(make_site(straight(1500.0), turnouts=[entry_at(300.0)], **SIGNS, **URBAN))
    assert [sign.station for sign in beside(furniture, "right", TrafficSign) if sign.code.startswith("274")] == [
        pytest.approx(30.0),
        pytest.approx(760.0),
    ]
    assert [sign.station for sign in beside(furniture, "left", TrafficSign)] == [pytest.approx(1470.0)]
    limits = {s.text for seed in range(20) for s in coded(place(make_site(seed=seed, **SIGNS, **URBAN)), "274")}
    assert limits == {("80",), ("100",)}
    assert not coded(place(make_site(straight(1500.0), turnouts=[entry_at(300.0)], **SIGNS)), "274")


@pytest.mark.parametrize(("radius", "right", "left"), [(1000.0, "103-10", "103-20"), (-1000.0, "103-20", "103-10")])
def test_danger_signs_before_tight_curves(radius: float, right: str, left: str) -> None:
    furniture = place(make_site(curve(radius), **SIGNS))
    for side, code, stations in (("right", right, (450.0, 650.0)), ("left", left, (1350.0, 1550.0))):
        assert [(s.code, s.station) for s in beside(furniture, side, TrafficSign)] == [
            (code, pytest.approx(station)) for station in stations
        ]
    assert not of(place(make_site(curve(1200.0), **SIGNS)), TrafficSign)


def test_double_curves() -> None:
    bend = 1.0 / 1000.0
    elements = [(700.0, 0.0, 0.0), (100.0, 0.0, bend), (200.0, bend, bend), (100.0, bend, 0.0)]
    elements += [(100.0, 0.0, -bend), (200.0, -bend, -bend), (100.0, -bend, 0.0), (700.0, 0.0, 0.0)]
    furniture = place(make_site(elements, **SIGNS))
    assert {sign.code for sign in beside(furniture, "right", TrafficSign)} == {"105-10"}
    # The other direction meets the second curve first: it bends to the left for it, too.
    assert {sign.code for sign in beside(furniture, "left", TrafficSign)} == {"105-10"}
    assert len(beside(furniture, "right", TrafficSign)) == 2


def test_signs_on_both_sides_where_the_median_has_room() -> None:
    narrow = place(make_site(curve(1000.0), **SIGNS))
    assert not [name for name in narrow if name.startswith("sign-median")]
    section = StandardCrossSection((3.75, 3.75), 3.0, 0.75, 0.75, 6.0)
    wide = place(make_site(curve(1000.0), section=section, **SIGNS))
    in_median = [sign for name, sign in wide.items() if name.startswith("sign-median")]
    assert len(in_median) == 4
    for sign in in_median:
        assert sign.width / 2.0 + 0.2 < abs(sign.offset) < 3.0 - 0.5 - sign.width / 2.0
        assert (sign.offset < 0.0) == (sign.rotation_deg == 0.0)


def test_signs_before_and_behind_a_construction_zone() -> None:
    furniture = {"signs": True, "construction_zone": 1.0}
    found = 0
    for seed in range(12):
        site = make_site(straight(3000.0), seed=seed, furniture=furniture)
        placed = place(site)
        line = placed["marking-construction-left"]
        signs = {sign.code: sign.station for sign in beside(placed, "left", TrafficSign)}
        wanted = {"123": 400.0, "274-100": 300.0, "121-10": 200.0, "274-80": 100.0}
        for code, distance in wanted.items():
            station = line.end_station + distance
            assert (code in signs) == (station <= 3000.0)
            if code in signs:
                found += 1
                assert signs[code] == pytest.approx(station, abs=20.0)
        if line.start_station >= 30.0:
            assert signs["282"] == pytest.approx(line.start_station - 30.0, abs=20.0)
    assert found > 30
