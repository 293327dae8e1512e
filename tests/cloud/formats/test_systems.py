"""Declarations of a cloud's file on its coordinate system and units: used, refused, or told."""

from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.crs import MapSystem, wkt
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.cloud.tools.convert import convert
from synthroads_addon.cloud.tools.divide import merge
from synthroads_addon.cloud.tools.statistics import cloud_statistics
from tests.helpers.clouds.declared_systems import FOOT, METRES, Declared, esri, gdal, write_e57
from tests.helpers.clouds.random_points import make_points
from tests.helpers.logged import logged
from tests.judges import require

FEET, CALIFORNIA = (FOOT, FOOT, FOOT), (1_900_000.0, 640_000.0, 150.0)
LOCAL = (0.0, 0.0, 0.0)
WITHOUT_CODE = gdal(25832).replace(',AUTHORITY["EPSG","25832"]', "")
ENDS_IN_UNIT = WITHOUT_CODE[: WITHOUT_CODE.rindex(',AXIS["Easting"')] + "]"
IN_FEET = gdal(25832).replace('UNIT["metre",1,AUTHORITY["EPSG","9001"]]', f'UNIT["foot",{FOOT!r}]')
TOWGS84 = gdal(31467).replace(',AUTHORITY["EPSG","6314"]', ",TOWGS84[598.1,73.7,418.2,0.202,0.045,-2.455,6.7]", 1)
DEPTHS = gdal("EPSG:25832+7837").replace('AXIS["Gravity-related height",UP]', 'AXIS["Depth",DOWN]')

UNDERSTOOD = {
    "WKT": (Declared(gdal(25832)), (25832, None), ()),
    "WKT 2": (Declared(str(CRS(25832).to_wkt("WKT2_2019"))), (25832, None), ()),
    "no code": (Declared(WITHOUT_CODE), (25832, None), ()),
    "ends in its unit": (Declared(ENDS_IN_UNIT), (25832, None), ()),
    "ESRI": (Declared(esri(25832)), (25832, None), ()),
    "ESRI, heights behind a comma": (Declared(f"{esri(25832)},{esri(7837)}"), (25832, 7837), ()),
    "ESRI, French": (Declared(esri(2154), corner=(700_000.0, 6_600_000.0, 80.0)), (2154, None), ()),
    "pair": (Declared(gdal("EPSG:25832+7837")), (25832, 7837), ()),
    "pair with a code": (Declared(gdal(5555)), (25832, 5783), ()),
    "behind the points": (Declared(gdal(25832), behind=True), (25832, None), ()),
    "pair behind the points": (Declared(gdal("EPSG:25832+7837"), behind=True), (25832, 7837), ()),
    "ESRI behind the points": (Declared(esri(25832), behind=True), (25832, None), ()),
    "shift to WGS 84": (Declared(TOWGS84), (31467, None), ()),
    "axes north, east": (Declared(gdal(3035)), (3035, None), ()),
    "keys": (Declared(keys=((1024, 1), (3072, 25832))), (25832, None), ()),
    "keys, model missing": (Declared(keys=((3072, 25832),)), (25832, None), ()),
    "keys, pair": (Declared(keys=((1024, 1), (3072, 25832), (4096, 7837))), (25832, 7837), ()),
    "keys, heights by the former code": (
        Declared(keys=((1024, 1), (3072, 26941), (4096, 5103)), corner=CALIFORNIA),
        (26941, 5703),
        (),
    ),
    "keys add heights": (
        Declared(gdal(25832), keys=((1024, 1), (3072, 25832), (4096, 7837))),
        (25832, 7837),
        (),
    ),
    "site": (Declared('LOCAL_CS["site",UNIT["metre",1]]', corner=LOCAL), (None, None), ()),
    "nothing": (Declared(), (None, None), ()),
    "feet": (Declared(gdal(2225), unit=FEET, corner=CALIFORNIA), (26941, None), ("EPSG:2225", "no unit of heights")),
    "feet behind the points": (
        Declared(gdal(2225), behind=True, unit=FEET, corner=CALIFORNIA),
        (26941, None),
        ("read in metres",),
    ),
    "feet, ESRI": (Declared(esri(2225), unit=FEET, corner=CALIFORNIA), (26941, None), ("read in metres",)),
    "feet, pair": (
        Declared(gdal("EPSG:2225+6360"), unit=FEET, corner=CALIFORNIA),
        (26941, 5703),
        ("EPSG:26941 + EPSG:5703",),
    ),
    "feet, heights in metres": (
        Declared(gdal("EPSG:2225+5703"), unit=(FOOT, FOOT, 1.0), corner=CALIFORNIA),
        (26941, 5703),
        ("a unit of its heights is 1 m",),
    ),
    "metres, heights in feet": (
        Declared(gdal("EPSG:26941+6360"), unit=(1.0, 1.0, FOOT), corner=CALIFORNIA),
        (26941, 5703),
        ("heights are in units of 0.30480061 m",),
    ),
    "keys, feet": (
        Declared(keys=((1024, 1), (3072, 2225), (3076, 9003), (4099, 9003)), unit=FEET, corner=CALIFORNIA),
        (26941, None),
        ("read in metres",),
    ),
    "keys, code of metres and unit of feet": (
        Declared(keys=((1024, 1), (3072, 26941), (3076, 9003)), unit=FEET, corner=CALIFORNIA),
        (26941, None),
        ("read in metres", "EPSG:2225"),
    ),
    "keys, heights in feet": (
        Declared(keys=((1024, 1), (3072, 25832), (4099, 9002)), unit=(1.0, 1.0, 0.3048)),
        (25832, None),
        ("heights are in units of 0.3048 m",),
    ),
    "keys, pair with heights in feet": (
        Declared(keys=((1024, 1), (3072, 26941), (4096, 5703), (4099, 9003)), unit=(1, 1, FOOT), corner=CALIFORNIA),
        (26941, 5703),
        ("heights are in units of",),
    ),
    "keys, no code, feet": (
        Declared(keys=((1024, 1), (3072, 32767), (3076, 9002)), unit=(0.3048,) * 3, corner=LOCAL),
        (None, None),
        ("a unit of which is 0.3048 m",),
    ),
    "keys, unit of their own": (
        Declared(keys=((1024, 1), (3072, 32767), (3076, 32767), (3077, 0.9144)), unit=(0.9144,) * 3, corner=LOCAL),
        (None, None),
        ("a unit of which is 0.9144 m",),
    ),
    "site in feet": (
        Declared('LOCAL_CS["site",UNIT["foot",0.3048]]', unit=(0.3048,) * 3, corner=LOCAL),
        (None, None),
        ("a unit of which is 0.3048 m",),
    ),
    "names a code and describes feet": (Declared(IN_FEET, unit=FEET), (None, None), ("ETRS89 / UTM zone 32N",)),
    "two systems": (
        Declared(gdal(25832), keys=((1024, 1), (3072, 25833))),
        (25832, None),
        ("two coordinate systems: EPSG:25832 is used, EPSG:25833 is ignored",),
    ),
    "two systems, keys count": (
        Declared(gdal(25832), bit=False, keys=((1024, 1), (3072, 25833))),
        (25833, None),
        ("EPSG:25833 is used, EPSG:25832 is ignored",),
    ),
    "no system": (Declared("here be dragons"), (None, None), ("can't be read (here be dragons)",)),
    "text cut off": (Declared(gdal(25832)[:200]), (None, None), ("can't be read (PROJCS",)),
    "unknown code": (Declared(keys=((1024, 1), (3072, 39999))), (None, None), ("EPSG:39999 is unknown",)),
    "unknown heights": (Declared(keys=((3072, 25832), (4096, 4096))), (25832, None), ("system 4096 is unknown",)),
    "unknown unit": (Declared(keys=((3072, 25832), (3076, 9999))), (25832, None), ("code 9999 is unknown",)),
}


@pytest.mark.parametrize("name", UNDERSTOOD)
def test_systems_of_las_are_used_and_what_is_not_is_told(name: str, tmp_path: Path) -> None:
    declared, codes, told = UNDERSTOOD[name]
    path = declared.write(tmp_path / "cloud.las")
    with logged() as messages, open_cloud(path) as cloud:
        xyz = concatenate(list(cloud.blocks())).xyz
        header = cloud.header
    np.testing.assert_allclose(xyz, declared.points, atol=2e-5)
    assert (header.epsg, header.height_epsg) == codes
    assert header.system is None or header.system.in_metres
    assert all(text in "\n".join(messages) for text in told), messages
    assert bool(messages) == bool(told), messages


REFUSED = {
    "degrees": (Declared(gdal(4326), corner=(9.0, 50.0, 100.0)), "EPSG:4326.*degrees: metres or feet"),
    "degrees, ESRI": (Declared(esri(4269), corner=(-120.0, 40.0, 100.0)), "EPSG:4269.*degrees"),
    "degrees and ellipsoidal heights": (Declared(str(CRS(4979).to_wkt("WKT2_2019"))), "EPSG:4326.*degrees"),
    "keys, degrees": (Declared(keys=((1024, 2), (2048, 4326))), "geographic, EPSG:4326.*degrees"),
    "keys, degrees, model missing": (Declared(keys=((2048, 4258),)), "geographic, EPSG:4258.*degrees"),
    "geocentric": (Declared(gdal(4978)), "geocentric"),
    "keys, geocentric": (Declared(keys=((1024, 3),)), "geocentric.*the Earth's centre"),
    "axes west and south": (Declared(gdal(2053)), "has axes west and south"),
    "heights alone": (Declared(gdal(7837)), "has heights only"),
    "depths": (Declared(DEPTHS), "counted downwards"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_systems_of_no_map_are_refused_by_name(name: str, tmp_path: Path) -> None:
    declared, said = REFUSED[name]
    path = declared.write(tmp_path / "cloud.las")
    with pytest.raises(InputError, match=said) as caught:
        open_cloud(path)
    assert "\n" not in str(caught.value)


E57 = {
    "WKT": (gdal(25832), (25832, None), ""),
    "pair": (gdal("EPSG:25832+7837"), (25832, 7837), ""),
    "ESRI": (esri(25832), (25832, None), ""),
    "WKT 2": (str(CRS(25832).to_wkt("WKT2_2019")), (25832, None), ""),
    "code": ("EPSG:25832", (25832, None), ""),
    "nothing": ("", (None, None), ""),
    "no system": ("Gauss-Krueger, as usual", (None, None), "can't be read"),
}


@pytest.mark.parametrize("name", E57)
def test_systems_of_e57(name: str, tmp_path: Path) -> None:
    require("pye57")
    text, codes, told = E57[name]
    path = write_e57(tmp_path / "cloud.e57", text, (294_000.0, 5_628_000.0, 180.0))
    with logged() as messages, open_cloud(path) as cloud:
        assert (cloud.header.epsg, cloud.header.height_epsg) == codes
        np.testing.assert_allclose(next(cloud.blocks()).xyz[:, 1], METRES[:, 1] + 5_628_000.0)
    assert bool(told) == bool(messages)
    assert told in "\n".join(messages)


@pytest.mark.parametrize(("system", "said"), [(2225, "EPSG:2225'.*isn't in metres"), (4326, "EPSG:4326'.*degrees")])
def test_e57_in_other_units_than_the_standard_s_is_refused(system: int, said: str, tmp_path: Path) -> None:
    require("pye57")
    path = write_e57(tmp_path / "cloud.e57", gdal(system), CALIFORNIA)
    with pytest.raises(InputError, match=said):
        open_cloud(path)


PAIRS = [(25832, None), (25832, 7837), (25832, 5783), (2056, 5728), (31467, None), (3035, None), (2154, 5720)]


@pytest.mark.parametrize("ending", [".las", ".laz", ".ply", ".pcd", ".e57", ".npz"])
@pytest.mark.parametrize("codes", PAIRS, ids=str)
def test_every_writer_keeps_both_codes(codes: tuple[int, int | None], ending: str, tmp_path: Path) -> None:
    if ending == ".e57":
        require("pye57")
    points = make_points(30)
    with open_writer(tmp_path / f"a{ending}", None, points.xyz[0], 1e7, crs_text=wkt(*codes)) as writer:
        writer.write(points)
    with open_cloud(tmp_path / f"a{ending}") as cloud:
        assert (cloud.header.epsg, cloud.header.height_epsg) == codes
        assert cloud.header.crs_text == wkt(*codes)


@pytest.mark.parametrize("ending", [".las", ".laz", ".ply", ".pcd", ".e57", ".npz"])
@pytest.mark.parametrize("name", ["pair", "ESRI", "feet", "feet, pair", "keys, pair", "metres, heights in feet"])
def test_converted_clouds_of_others_keep_place_and_codes(name: str, ending: str, tmp_path: Path) -> None:
    if ending == ".e57":
        require("pye57")
    declared, codes, _ = UNDERSTOOD[name]
    convert(declared.write(tmp_path / "cloud.las"), tmp_path / f"out{ending}")
    with open_cloud(tmp_path / f"out{ending}") as cloud:
        assert (cloud.header.epsg, cloud.header.height_epsg) == codes
        assert cloud.header.place.scale is None
        np.testing.assert_allclose(concatenate(list(cloud.blocks())).xyz, declared.points, atol=1e-3)


def test_figures_of_a_cloud_in_feet_are_in_metres(tmp_path: Path) -> None:
    declared = UNDERSTOOD["feet, pair"][0]
    with open_cloud(declared.write(tmp_path / "cloud.las")) as cloud:
        figures = cloud_statistics(cloud, samples=0)
    span = np.subtract(figures["bounds"]["high"], figures["bounds"]["low"])
    np.testing.assert_allclose(span, [10.0, 20.0, 1.5], atol=1e-3)
    assert figures["coordinate_system"] == "EPSG:26941 + EPSG:5703"
    assert figures["unit_factors"] == pytest.approx(FEET)


def test_clouds_with_other_heights_are_not_merged(tmp_path: Path) -> None:
    for name in ("pair", "pair with a code"):
        UNDERSTOOD[name][0].write(tmp_path / f"{name}.las")
    with pytest.raises(InputError, match="has a different coordinate system"):
        merge([tmp_path / "pair.las", tmp_path / "pair with a code.las"], tmp_path / "out.las")


@pytest.mark.parametrize(
    ("codes", "said"),
    [
        ((7837, None), "epsg is 7837: .*has heights only"),
        ((99999, None), "epsg is 99999: must be the EPSG code of a coordinate system"),
        ((4978, None), "epsg is 4978: .*geocentric"),
        ((25832, 25833), "height_epsg is 25833: must be the EPSG code of a vertical"),
        ((5555, 7837), "height_epsg is 7837: EPSG:5555 already names"),
        ((25832, 5715), "counted downwards"),
    ],
    ids=str,
)
def test_codes_of_the_wrong_kind_are_refused(codes: tuple[int, int | None], said: str) -> None:
    with pytest.raises(InputError, match=said):
        MapSystem.of(*codes)
