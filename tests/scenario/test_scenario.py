"""Scenarios: changes by path, and what is read is what was written."""

import pytest

from synthroads_addon.base.changes import apply_change, parse_change
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.guidelines import SECTIONS_OF_CLASS, STANDARD_CROSS_SECTIONS
from synthroads_addon.scanning.devices.device import device_names
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_names


def test_changes_are_applied_and_unknown_keys_named() -> None:
    data = apply_change({"a": {"b": 1}}, "a.c=[1,2]", Scenario)
    assert data == {"a": {"b": 1, "c": [1, 2]}}
    with pytest.raises(InputError, match="did you mean 'platform'"):
        load_scenario("rq31-600m", ["scan.platfrom.height=3"])
    assert Scenario.from_dict(load_scenario("rq31-600m").to_dict()) == load_scenario("rq31-600m")


def test_a_platform_has_the_fields_of_its_kind_only() -> None:
    with pytest.raises(
        InputError, match=r"scan\.platform: speed can't be given for tripod, only for uav, vehicle, airborne"
    ):
        Scenario.from_dict({"scan": {"platform": {"kind": "tripod", "speed": 3.0}}})
    with pytest.raises(InputError, match=r"scan\.platform\.kind is 'uvv': must be one of .*did you mean 'uav'"):
        Scenario.from_dict({"scan": {"platform": {"kind": "uvv"}}})
    assert Scenario.from_dict({"scan": {"platform": {"height": 3.0}}}).scan.platform.kind == "uav"


def test_another_kind_of_platform_or_weather_begins_anew() -> None:
    mounted = "scan.platform.pitch_deg=10"
    vehicle = load_scenario("rq31-600m", [mounted, "scan.platform.kind=vehicle"]).scan.platform
    assert (vehicle.kind, vehicle.height, vehicle.lateral_offsets, vehicle.pitch_deg) == ("vehicle", None, None, 10.0)
    changes = ["scan.platform.height=2.5", "scan.platform.kind=vehicle"]
    for order in (changes, changes[::-1]):
        assert load_scenario("rq31-600m", order).scan.platform.height == 2.5
    assert load_scenario("rq31-600m", ["scan.platform.kind=uav"]) == load_scenario("rq31-600m")
    fog = load_scenario(
        "rq31-600m", ['scan.weather={"condition": "rain", "rate_mm_h": 5}', "scan.weather.condition=fog"]
    )
    assert fog.scan.weather.to_dict() == {"condition": "fog", "echoes": False}


TYPED = {
    "cloud.classes=5": "5",
    'cloud.classes="5"': "5",
    "title=007": "007",
    "title=7": "7",
    "title=1e5": "1e5",
    "title=true": "true",
    "title=[1]": "[1]",
    'title="in quotes"': "in quotes",
    "materials_table=null": None,
    "seed=7": 7,
    "road.length=8e2": 800.0,
    "time_budget=2min": "2min",
    "time_budget=60": 60,
    "tolerance.height=5mm": "5mm",
    "colour.rgb=false": False,
    "scan.rays_per_pulse=19": 19,
    "scan.weather.visibility=300": 300,
    "outputs=[]": [],
    "road.radius.minimum=900": 900,
    "road.cross_section=RQ31": "RQ31",
    'road.cross_section={"lanes": [3.5]}': {"lanes": [3.5]},
    'road.cross_section={"lane": [3.5]}': {"lane": [3.5]},
    "no.such.field=5": 5,
    "road.length=long": "long",
    "seed=1.5": 1.5,
    "title=null": None,
}
"""Change -> its value: of the field's type, and where the field takes neither form, what names the fault best."""


@pytest.mark.parametrize("change", TYPED)
def test_values_are_of_the_type_of_their_field(change: str) -> None:
    path, value = parse_change(change, Scenario)
    assert path == change.partition("=")[0]
    assert value == TYPED[change]
    assert type(value) is type(TYPED[change])


def test_a_number_for_text_needs_no_quotes() -> None:
    scenario = load_scenario("rq31-600m", ["cloud.classes=5", "title=007", "road.length=800"])
    assert (scenario.cloud.classes, scenario.title, scenario.road.length) == ("5", "007", 800.0)
    with pytest.raises(InputError, match="is 'RQ31': must be a JSON object before its field lanes can be set"):
        load_scenario("rq31-600m", ["road.cross_section.lanes=[3.5]"])


def section_of(road: dict[str, str]) -> tuple[str, str]:
    made = Scenario.from_dict({"road": road}).road
    return made.design_class, str(made.cross_section)


def test_a_design_class_alone_has_a_cross_section_that_fits() -> None:
    usual = {name: section_of({"design_class": name})[1] for name in SECTIONS_OF_CLASS}
    motorways = {"EKA1A": "RQ31", "EKA1B": "RQ31", "EKA2": "RQ28", "EKA3": "RQ25"}
    country = {"EKL1": "RQ15.5", "EKL2": "RQ11.5+", "EKL3": "RQ11", "EKL4": "RQ9"}
    others = {"R80": "FR7.0", "R60": "FR6.0", "DMRB100": "S2", "DMRB85": "S2", "DMRB70": "GB6.0"}
    assert usual == motorways | country | others
    for section in STANDARD_CROSS_SECTIONS:
        assert section in SECTIONS_OF_CLASS[section_of({"cross_section": section})[0]]
    assert section_of({}) == section_of({"cross_section": "RQ31"}) == ("EKA1A", "RQ31")
    with pytest.raises(InputError, match=r"cross_section is 'RQ31': EKA3 allows RQ38\.5, RQ31\.5, RQ25"):
        section_of({"design_class": "EKA3", "cross_section": "RQ31"})


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        (["road.design_class=EKA3"], ("EKA3", "RQ25")),
        (["road.design_class=EKA2"], ("EKA2", "RQ31")),  # which it may have
        (["road.cross_section=RQ31.5"], ("EKA3", "RQ31.5")),
        (["road.cross_section=RQ36"], ("EKA1A", "RQ36")),
        (["road.design_class=EKA3", "road.cross_section=RQ31.5"], ("EKA3", "RQ31.5")),
    ],
)
def test_of_class_and_section_the_one_that_no_change_names_gives_way(
    changes: list[str], found: tuple[str, str]
) -> None:
    road = load_scenario("rq31-600m", changes).road
    assert (road.design_class, road.cross_section) == found


def test_class_and_section_that_are_both_named_are_refused() -> None:
    with pytest.raises(InputError, match="cross_section is 'RQ31': EKA3 allows"):
        load_scenario("rq31-600m", ["road.design_class=EKA3", "road.cross_section=RQ31"])
    by_hand = load_scenario("rq31-600m", ['road.cross_section={"lanes": [3.5]}', "road.design_class=EKA3"])
    assert by_hand.to_dict()["road"]["cross_section"]["lanes"] == [3.5]
    with pytest.raises(InputError, match="design_class is 'EKA4'"):
        load_scenario("rq31-600m", ["road.design_class=EKA4"])


@pytest.mark.parametrize("device", device_names())
def test_settings_that_another_device_cannot_do_give_way(device: str) -> None:
    for name in scenario_names():
        scanner_setting(load_scenario(name, [f"scan.device={device}"]).scan)


def test_settings_that_a_device_can_do_and_those_named_with_it_stay() -> None:
    scan = load_scenario("rq31-600m", ["scan.device=riegl-vux-1uav22"]).scan
    assert (scan.pulse_rate_khz, scan.field_of_view_deg, scan.lines_per_second) == (200.0, 180.0, 100.0)
    scan = load_scenario("rq31-600m", ["scan.device=riegl-vq-780i"]).scan
    assert (scan.pulse_rate_khz, scan.field_of_view_deg, scan.lines_per_second) == (None, None, 100.0)
    named = load_scenario("rq31-600m", ["scan.device=velodyne-vlp-16", "scan.pulse_rate_khz=200"]).scan
    with pytest.raises(InputError, match=r"pulse_rate_khz is 200\.0: Velodyne VLP-16 fires at 289\.352 kHz"):
        scanner_setting(named)
    own = Scenario.from_dict({"scan": {"device": "velodyne-vlp-16", "pulse_rate_khz": 200.0}}).scan
    with pytest.raises(InputError, match=r"pulse_rate_khz is 200\.0"):
        scanner_setting(own)


def test_settings_give_way_to_a_device_on_another_platform() -> None:
    """The fields of the platform before, which the new one hasn't, don't keep them."""
    scan = load_scenario("rq31-600m", ["scan.device=velodyne-vlp-16", "scan.platform.kind=vehicle"]).scan
    assert scan.pulse_rate_khz is None
    scanner_setting(scan)
