"""Objects and signals of other programs as things: by words, repeats, and codes; and what has none."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.road.things.thing import Thing
from tests.helpers.roads.lane_files import LENGTH, cubic, lane, lanes, road_file, section, taken, width

LANES = lanes(section(0.0, lane(1, width(0.0, 3.5)), lane(-1, width(0.0, 3.5))))


def things_of(folder: Path, objects: str = "", signals: str = "", before: str = "") -> tuple[dict, dict]:
    rest = f"{before}{LANES}<objects>{objects}</objects><signals>{signals}</signals>"
    parameters, _, report = taken(road_file(folder, rest))
    return parameters.of_type(Thing), report["whole"]


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ('type="barrier" subtype="guardRail"', "Guardrail"), ('type="railing" name="railing.osgb"', "Guardrail"),
        ('type="barrier" name="jersey wall"', "ConcreteBarrier"), ('type="soundBarrier"', "NoiseBarrier"),
        ('type="barrier" subtype="fence"', "Fence"), ('type="vegetation" subtype="hedge"', "Hedge"),
        ('type="barrier" subtype="wall"', "Wall"), ('type="barrier"', "ConcreteBarrier"),
    ],
)  # fmt: skip
def test_what_runs_along_the_road(tmp_path: Path, words: str, kind: str) -> None:
    repeat = '<repeat s="20" length="100" distance="0" tStart="-6" tEnd="-6" heightStart="0.8" heightEnd="0.8"/>'
    found, _ = things_of(tmp_path, f'<object id="1" s="20" t="-6" {words}>{repeat}</object>')
    (thing,) = found.values()
    assert thing.type == kind
    assert (thing.start_station, thing.end_station, thing.offset) == (20.0, 120.0, -6.0)


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ('type="guide-post"', "Delineator"), ('type="pole" subtype="reflectorPost"', "Delineator"),
        ('type="streetLamp"', "Pole"), ('type="pole"', "Pole"),
        ('type="obstacle" name="TrafficCone01"', "ConstructionBeacon"),
        ('type="building" length="12" width="8" height="6"', "Building"), ('type="gantry" width="24"', "Gantry"),
        ('type="obstacle" name="manhole"', "Shaft"), ('type="obstacle" name="emergency phone"', "Cabinet"),
    ],
)  # fmt: skip
def test_what_stands_beside_the_road(tmp_path: Path, words: str, kind: str) -> None:
    found, _ = things_of(tmp_path, f'<object id="1" s="50" t="-20" hdg="0.5" {words}/>')
    (thing,) = found.values()
    assert (thing.type, thing.station, thing.offset) == (kind, 50.0, -20.0)
    assert thing.rotation_deg == pytest.approx(math.degrees(0.5), abs=1e-5)


def test_things_that_are_only_in_a_repeat(tmp_path: Path) -> None:
    repeat = '<repeat s="10" length="150" distance="50" tStart="-5" tEnd="-8"/>'
    found, _ = things_of(tmp_path, f'<object id="1" s="0" t="0" type="guide-post" height="0.9">{repeat}</object>')
    posts = [item for item in found.values() if isinstance(item, Delineator)]
    assert [post.station for post in posts] == [10.0, 60.0, 110.0, 160.0]
    assert [post.offset for post in posts] == pytest.approx([-5.0, -6.0, -7.0, -8.0])
    assert {post.height for post in posts} == {0.9}


def test_a_barrier_that_runs_askew_is_told(tmp_path: Path) -> None:
    rows = '<repeat s="0" length="100" distance="0" tStart="-6" tEnd="-6"/>'
    rows += '<repeat s="100" length="50" distance="0" tStart="-6" tEnd="-9"/>'
    found, report = things_of(tmp_path, f'<object id="1" s="0" t="-6" type="guardrail">{rows}</object>')
    rails = [item for item in found.values() if isinstance(item, Guardrail)]
    assert [(rail.start_station, rail.end_station, rail.offset) for rail in rails] == [(0, 100, -6), (100, 150, -7.5)]
    (row,) = [row for row in report["approximated"] if row["kind"] == "guardrails"]
    assert (row["deviation"], row["station"]) == (1.5, 125.0)


def test_places_are_those_in_the_tilted_plane(tmp_path: Path) -> None:
    before = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.1)}</lateralProfile>"
    found, _ = things_of(tmp_path, '<object id="1" s="50" t="-10" zOffset="1" type="guide-post"/>', "", before)
    (post,) = found.values()
    assert post.offset == pytest.approx(-10.0 * math.cos(0.1) - math.sin(0.1), abs=1e-6)


@pytest.mark.parametrize(
    ("attributes", "code"),
    [
        ('type="274" subtype="-1" value="27.7778"', "274-100"), ('type="274" value="62.1371" unit="mph"', "274-100"),
        ('type="274" value="120" unit="km/h"', "274-120"), ('type="276" subtype="-1"', "276"),
    ],
)  # fmt: skip
def test_signals_are_signs_by_their_code(tmp_path: Path, attributes: str, code: str) -> None:
    """A speed without a unit is in m/s."""
    signal = f'<signal id="1" name="s" s="40" t="-8" orientation="-" hOffset="0" country="DE" {attributes}/>'
    found, _ = things_of(tmp_path, "", signal)
    (sign,) = found.values()
    assert isinstance(sign, TrafficSign)
    assert (sign.code, sign.station, sign.offset) == (code, 40.0, -8.0)
    assert abs(sign.rotation_deg) == 180.0


def test_what_has_no_thing_is_counted(tmp_path: Path) -> None:
    objects = '<object id="1" s="5" t="9" type="tree"/><object id="2" s="9" t="9" type="tree"/>'
    objects += '<object id="3" s="9" t="9" type="-1"/><bridge id="4" s="50" length="20" type="concrete"/>'
    found, report = things_of(tmp_path, objects, '<signal id="9" s="40" t="-8" type="R1-1" subtype="a"/>')
    assert found == {}
    lost = {row["kind"]: row["count"] for row in report["left_out"]}
    assert lost == {"plants": 2, "-1 objects": 1, "bridges": 1, "signals": 1}
    assert not report["surface_lost"]


def test_bridges_and_tunnels_are_told_with_their_stretch(tmp_path: Path) -> None:
    objects = '<tunnel id="1" s="50" length="30" type="standard"/><tunnel id="2" s="180" length="90" type="standard"/>'
    _, report = things_of(tmp_path, objects)
    (row,) = report["left_out"]
    assert (row["kind"], row["count"], row["stretches"]) == ("tunnels", 2, [[50.0, 80.0], [180.0, LENGTH]])


def test_sizes_are_those_of_the_file(tmp_path: Path) -> None:
    objects = '<object id="1" s="50" t="-9" type="obstacle" name="cabinet" length="1.2" width="0.5" height="1.4"/>'
    objects += '<object id="2" s="60" t="-9" type="obstacle" name="manhole" radius="0.4"/>'
    objects += '<object id="3" s="70" t="-9" type="obstacle" name="barrel" radius="0.2" height="1.1"/>'
    objects += '<object id="4" s="80" t="-9" type="pole" radius="0.1" height="9"/>'
    found, report = things_of(tmp_path, objects)
    cabinet, shaft, barrel, pole = found.values()
    assert (cabinet.width, cabinet.depth, cabinet.height) == (1.2, 0.5, 1.4)
    assert (shaft.kind, shaft.size) == ("manhole", 0.8)
    assert (barrel.width, barrel.height) == (0.4, 1.1)
    assert (pole.diameter, pole.height) == (0.2, 9.0)
    assert not [row for row in report["approximated"] if row["deviation"]]


def test_sizes_beyond_a_things_limits_are_told(tmp_path: Path) -> None:
    row = '<repeat s="20" length="100" distance="0" tStart="-6" tEnd="-6"/>'
    found, report = things_of(
        tmp_path, f'<object id="1" s="20" t="-6" type="barrier" name="wall" height="9">{row}</object>'
    )
    (wall,) = found.values()
    (told,) = [row for row in report["approximated"] if row["kind"] == "walls"]
    assert told["deviation"] == pytest.approx(9.0 - wall.height)


@pytest.mark.parametrize(
    ("repeat", "why"),
    [
        ('<repeat s="10" length="150" distance="1e-9" tStart="-5" tEnd="-5"/>', "more than 10,000 copies"),
        ('<repeat s="900" length="150" distance="50" tStart="-5" tEnd="-5"/>', "behind the road's end"),
    ],
)
def test_repeats_that_no_road_has(tmp_path: Path, repeat: str, why: str) -> None:
    found, report = things_of(tmp_path, f'<object id="1" s="0" t="0" type="guide-post">{repeat}</object>')
    assert found == {}
    (row,) = report["left_out"]
    assert why in row["why"]


def test_copies_end_with_the_road_and_each_is_judged_alone(tmp_path: Path) -> None:
    repeat = '<repeat s="100" length="1e6" distance="50" tStart="-5" tEnd="-5"/>'
    repeat += '<repeat s="10" length="20" distance="10" tStart="-1500" tEnd="-5"/>'
    found, report = things_of(tmp_path, f'<object id="1" s="0" t="0" type="guide-post">{repeat}</object>')
    assert [post.station for post in found.values()] == [100.0, 150.0, 200.0, 20.0, 30.0]
    (row,) = report["left_out"]
    assert row["count"] == 1


@pytest.mark.parametrize(
    "inner",
    [
        '<userData code="object_type" value="Guardrail"/>',
        '<userData code="object_type" value="Delineator"/><userData code="height" value="{"/>',
        '<userData code="object_type" value="LineMarking"/>',
    ],
)
def test_what_our_own_files_say_of_an_object_may_be_broken(tmp_path: Path, inner: str) -> None:
    found, report = things_of(tmp_path, f'<object id="1" s="50" t="-6" type="barrier">{inner}</object>')
    assert found == {}
    assert len(report["left_out"]) == 1


def test_furniture_is_drawn_where_the_file_has_no_objects(tmp_path: Path) -> None:
    parameters, _, report = taken(road_file(tmp_path, LANES))
    assert parameters.of_type(Delineator)
    assert "Delineator" not in report["whole"]["read"]
