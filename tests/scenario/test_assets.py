"""Asset libraries: every fault named, and assets placed by their rules, beside the road and nowhere else."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject
from synthroads_addon.road.section import Carriageway, Ramp, Turnout
from synthroads_addon.road.surroundings import Terrain
from synthroads_addon.road.things.asset import Asset
from synthroads_addon.sampling.placing.assets import sample_assets
from synthroads_addon.sampling.placing.site import PlacementSite
from synthroads_addon.scenario.assets import AssetLibrary, read_asset_library
from synthroads_addon.scenario.road import RoadScenario

ROAD_EDGE = 2.0 + 0.75 + 3.75 + 0.5 + 2.5 + 1.5


def within(low: float, high: float) -> dict[str, float]:
    return {"minimum": low, "maximum": high}


def entry(**changes: Any) -> dict[str, Any]:
    """Return an asset of a library; changes to its placement by their own names."""
    placement = {"side": "both", "distance": within(3.0, 8.0), "spacing": within(20.0, 30.0)}
    own = {"file": "models/bench.glb", "class_name": "utility"}
    for key, value in changes.items():
        (own if key in ("file", "object", "class_name", "scale", "placement", "colour") else placement)[key] = value
    return {"placement": {key: value for key, value in placement.items() if value is not None}} | own


def library(folder: Path, changes: dict[str, Any] | None = None, **assets: dict[str, Any]) -> Path:
    """Write a library with the files that the tests name."""
    (folder / "models").mkdir(exist_ok=True)
    for name in ("bench.glb", "tree.obj", "all.blend"):
        (folder / "models" / name).write_bytes(b"glTF")
    path = folder / "library.json"
    content = {"type": "AssetLibrary", "version": "1.0", "assets": assets or {"bench": entry()}} | (changes or {})
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def site(
    *libraries: Path, seed: int = 1, length: float = 600.0, half_width: float = 78.0, turnouts=()
) -> PlacementSite:
    """Return a straight road of one lane per direction."""
    scenario = RoadScenario(length=length, half_width=half_width, assets=tuple(str(path) for path in libraries))
    axis = AlignmentObject(
        instance=1,
        start_x=0.0,
        start_y=0.0,
        start_heading_deg=0.0,
        horizontal=(HorizontalElement.between(length, 0.0, 0.0),),
        vertical=(VerticalPoint(station=0.0, elevation=0.0),),
    )
    road = {
        "instance": 1,
        "inner_offset": 2.0,
        "hard_shoulder_width": 2.5,
        "outer_edge_strip_width": 0.5,
        "lanes": [{"width": 3.75}],
        "inner_edge_strip_width": 0.75,
        "verge_width": 1.5,
        "crossfall": [{"station": 0.0, "crossfall_percent": 2.5}],
    }
    sides = {side: Carriageway.from_dict(road | {"side": side}) for side in ("right", "left")}
    ground = Terrain(
        instance=1,
        half_width=half_width,
        embankment_height=0.0,
        undulation=0.0,
        wavelength=40.0,
        batter_slope=2.0,
        seed=1,
    )
    return PlacementSite(scenario, seed, axis, sides, {f"turnout-{i}": item for i, item in enumerate(turnouts)}, ground)


def placed(path: Path, **options: Any) -> list[Asset]:
    return [item for _, item in sample_assets(site(path, **options))]


# --- reading -------------------------------------------------------------------------------------------------------


def test_a_library_is_read_and_written_back(tmp_path: Path) -> None:
    assets = {
        "bench": entry(scale=1.5, rotation_deg=within(-5.0, 5.0)),
        "oak": entry(file="models/all.blend", object="Oak", class_name="vegetation", side="left", start_station=10.0),
        "rock": entry(
            file="models/tree.obj", class_name="ground", spacing=None, per_km=within(1.0, 2.0), side="median"
        ),
    }
    read = read_asset_library(library(tmp_path, **assets))
    assert list(read.assets) == ["bench", "oak", "rock"]
    assert read.assets["oak"].object == "Oak"
    assert read.assets["bench"].placement.rotation_deg.minimum == -5.0
    assert AssetLibrary.from_dict(json.loads(read.to_json())).to_json() == read.to_json()


OUTSIDE = "must lie in the library's folder: a relative path with / and without .."
BOTH_OR_NONE = ".placement: either spacing or per_km is needed, and not both"
FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "suffix": (entry(file="models/bench.fbx"), ".file: 'models/bench.fbx' must be one of .blend, .glb, .obj"),
    "no suffix": (entry(file="models/bench"), ".file: 'models/bench' must be one of .blend, .glb, .obj"),
    "outside": (entry(file="../bench.glb"), f".file: '../bench.glb' {OUTSIDE}"),
    "absolute": (entry(file="/models/bench.glb"), f".file: '/models/bench.glb' {OUTSIDE}"),
    "drive": (entry(file="C:/bench.glb"), f".file: 'C:/bench.glb' {OUTSIDE}"),
    "backslash": (entry(file="models\\bench.glb"), f".file: 'models\\bench.glb' {OUTSIDE}"),
    "object": (entry(object="Bench"), ": object is 'Bench': only a .blend file has named objects to choose from"),
    "unknown key": (entry(colour="red"), ": unknown key 'colour'"),
    "nearest key": (entry(distanse=within(1, 2)), ".placement: unknown key 'distanse' (did you mean 'distance'?)"),
    "side": (entry(side="top"), ".placement.side is 'top': "),
    "neither": (entry(spacing=None), BOTH_OR_NONE),
    "both": (entry(per_km=within(1.0, 2.0)), BOTH_OR_NONE),
    "on the road": (entry(distance=within(-1.0, 2.0)), ".placement: distance is -1 to 2: must be 0 to 1000"),
    "too close": (entry(spacing=within(0.0, 2.0)), ".placement: spacing is 0 to 2: must be 0.5 to 1e+06"),
    "too many": (entry(spacing=None, per_km=within(0.0, 1e6)), ".placement: per_km is 0 to 1e+06: must be 0 to 10000"),
    "rotation": (entry(rotation_deg=within(0, 400)), ".placement: rotation_deg is 0 to 400: must be -360 to 360"),
    "interval": (entry(distance=within(3.0, 2.0)), ".placement.distance: maximum 2.0 must not be less than minimum"),
    "end": (entry(start_station=50.0, end_station=20.0), ".placement: end_station is 20: must not be less than 50"),
    "scale": (entry(scale=0.0), ".scale is 0.0: "),
    "nothing placed": ({"file": "models/bench.glb", "class_name": "utility"}, ".placement: "),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_named(tmp_path: Path, fault: str) -> None:
    asset, message = FAULTS[fault]
    with pytest.raises(InputError, match=rf"library\.json: assets\.bench.*{re.escape(message)}"):
        read_asset_library(library(tmp_path, bench=asset))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"type": "Library"}, "type is 'Library': must be 'AssetLibrary'"),
        ({"version": "2.0"}, "version is '2.0': must be '1.0'"),
        ({"assets": {}}, "assets is {}: "),
        ({"assets": {"a b": entry()}}, "assets.a b"),
        ({"asets": {}}, r"unknown key 'asets' \(did you mean 'assets'\?\)"),
    ],
)
def test_fault_of_the_library_is_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_asset_library(library(tmp_path, changes))


def test_missing_library(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"library\.json: an asset library \(JSON\) is needed here"):
        read_asset_library(tmp_path / "library.json")


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"\xff\xfe"])
def test_no_library(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "library.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"library\.json"):
        read_asset_library(path)


def test_missing_file_of_an_asset(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(file="models/missing.glb"))
    expected = (
        r"library\.json: assets\.bench\.file is 'models/missing\.glb': cannot be read \(No such file or directory\)"
    )
    with pytest.raises(MissingFileError, match=expected):
        read_asset_library(path)


def test_folder_and_empty_file_in_place_of_an_asset(tmp_path: Path) -> None:
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(
        MissingFileError, match=r"assets\.bench\.file is 'folder\.glb': cannot be read \(Is a directory\)"
    ):
        read_asset_library(library(tmp_path, bench=entry(file="folder.glb")))
    (tmp_path / "empty.obj").touch()
    with pytest.raises(InputError, match=r"assets\.bench\.file is 'empty\.obj': the file is empty"):
        read_asset_library(library(tmp_path, bench=entry(file="empty.obj")))


def test_a_changed_library_is_read_anew(tmp_path: Path) -> None:
    path = library(tmp_path)
    assert list(read_asset_library(path).assets) == ["bench"]
    library(tmp_path, rock=entry())
    os.utime(path, ns=(1, 1))
    assert list(read_asset_library(path).assets) == ["rock"]


# --- placing -------------------------------------------------------------------------------------------------------


def test_no_libraries_no_assets() -> None:
    assert not list(sample_assets(site()))


def test_assets_stand_behind_the_verge_at_their_spacing(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(scale=2.0))
    drawn = [item for seed in range(20) for item in placed(path, seed=seed)]
    assert {(item.library, item.name, item.class_name, item.scale) for item in drawn} == {
        (str(path), "bench", "utility", 2.0)
    }
    distance = np.abs([item.offset for item in drawn]) - ROAD_EDGE
    assert distance.min() >= 3.0 - 1e-9
    assert distance.max() <= 8.0 + 1e-9
    assert np.ptp(distance) > 4.8
    assert np.ptp([placed(path, seed=seed)[0].station for seed in range(20)]) > 15.0
    for seed in range(20):
        items = placed(path, seed=seed)
        for sign in (-1, 1):
            stations = [item.station for item in items if item.offset * sign > 0]
            gaps = np.diff(stations)
            assert gaps.min() >= 20.0 - 1e-6
            assert gaps.max() <= 30.0 + 1e-6
            assert stations[0] <= 30.0
            assert 570.0 <= stations[-1] <= 600.0


@pytest.mark.parametrize(("side", "signs"), [("left", {1.0}), ("right", {-1.0}), ("both", {1.0, -1.0})])
def test_side(tmp_path: Path, side: str, signs: set[float]) -> None:
    assert {float(np.sign(item.offset)) for item in placed(library(tmp_path, bench=entry(side=side)))} == signs


def test_assets_in_the_median_stay_off_the_pavement(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(side="median", distance=within(0.5, 30.0), spacing=within(5.0, 6.0)))
    items = placed(path)
    offsets = np.array([item.offset for item in items])
    assert np.abs(offsets).max() <= 1.5
    assert (offsets > 0.5).any()
    assert (offsets < -0.5).any()
    assert len(items) == pytest.approx(600.0 / 5.5, abs=10)
    with pytest.raises(
        InputError, match=r"placement\.distance is 2\.5: there are at most 2 m in this half of the median"
    ):
        placed(library(tmp_path, bench=entry(side="median", distance=within(2.5, 3.0))))


def test_number_by_length(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(side="left", spacing=None, per_km=within(5.0, 15.0), end_station=200.0))
    counts = [len(placed(path, seed=seed)) for seed in range(200)]
    assert np.mean(counts) == pytest.approx(2.0, abs=0.3)
    assert set(counts) == {1, 2, 3}


def test_range_of_stations(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(start_station=100.0, end_station=300.0, spacing=within(2.0, 3.0)))
    stations = [item.station for item in placed(path)]
    assert 100.0 <= min(stations) < 103.0
    assert 297.0 < max(stations) <= 300.0
    assert not placed(library(tmp_path, bench=entry(start_station=700.0)))
    assert max(item.station for item in placed(library(tmp_path, bench=entry(end_station=5000.0)))) <= 600.0


def test_nothing_beyond_the_half_width(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(distance=within(2.0, 500.0)))
    offsets = np.abs([item.offset for seed in range(20) for item in placed(path, seed=seed, half_width=40.0)])
    assert offsets.max() <= 40.0
    assert offsets.max() > 38.0
    far = np.abs([item.offset for seed in range(20) for item in placed(path, seed=seed, half_width=400.0)])
    assert 98.0 < far.max() <= 100.0  # farther offsets are none


def test_no_room_anywhere_is_a_conflict_of_limits(tmp_path: Path) -> None:
    path = library(tmp_path, bench=entry(distance=within(30.0, 50.0)))
    expected = r"library\.json: assets\.bench\.placement\.distance is 30\.0: there are at most 29 m between the verge"
    with pytest.raises(InputError, match=expected):
        placed(path, half_width=40.0)


def test_assets_make_way_for_a_ramp(tmp_path: Path) -> None:
    """Beside an exit's ramp they count from its verge; where that leaves no room there are none."""
    turnout = Turnout(
        instance=1,
        carriageway="carriageway-right",
        kind="exit",
        start_station=100.0,
        taper_in_length=30.0,
        lane_length=200.0,
        lane_width=3.5,
        ramp=Ramp(length=160.0, clothoid_parameter=70.0),
    )
    path = library(tmp_path, bench=entry(distance=within(1.0, 500.0), spacing=within(1.0, 1.0)))
    for half_width in (78.0, 36.0):
        here = site(path, half_width=half_width, turnouts=[turnout])
        items = [item for _, item in sample_assets(here) if item.offset < 0.0]
        stations = np.array([item.station for item in items])
        behind = -np.array([item.offset for item in items]) - here.sections["right"].road_edge(stations)
        assert behind.min() >= 1.0 - 1e-6
        assert max(-item.offset for item in items) <= half_width
    beside = [item for item in items if 480.0 < item.station < 489.0]
    assert not beside
    assert [item for item in items if item.station > 530.0]


def test_assets_face_the_traffic_of_their_side(tmp_path: Path) -> None:
    items = placed(library(tmp_path, bench=entry(rotation_deg=within(-10.0, 20.0))))
    right = [item.rotation_deg for item in items if item.offset < 0.0]
    left = [item.rotation_deg % 360.0 - 180.0 for item in items if item.offset > 0.0]
    for angles in (right, left):
        assert -10.0 <= min(angles) < 0.0 < max(angles) <= 20.0


def test_several_libraries_have_their_own_numbers(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.mkdir()
    second.mkdir()
    paths = library(first), library(second)
    names = [name for name, _ in sample_assets(site(*paths))]
    assert len(set(names)) == len(names)
    alone = [item.station for item in placed(paths[0])]
    both = [item for _, item in sample_assets(site(*paths))]
    assert [item.station for item in both if item.library == str(paths[0])] == alone
    assert [item.station for item in both if item.library == str(paths[1])] != alone


def test_place_on_the_disk_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    here, there = placed(library(tmp_path)), placed(library(tmp_path / "elsewhere"))
    assert [(item.station, item.offset) for item in here] == [(item.station, item.offset) for item in there]
