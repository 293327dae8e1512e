"""The main job, end to end: files, truth of the labels, casters, reproducibility, real axes, wrong inputs."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import laspy
import numpy as np
import pytest

from headless import commands
from headless.generate import summary
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.crs import MapSystem
from synthroads_addon.blender.services import BlenderServices
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.job_files import FILES
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.label_truth import misplaced_points
from tests.helpers.logged import logged
from tests.helpers.scenes.scan_scenes import emit_pulses, scan_block

ROOT = Path(__file__).parents[2]
REAL_AXIS = ROOT.parent / "shared" / "real" / "als_rural2lane_t211-278_axis.csv"
SMALL = ["fidelity=draft", "road.length=120", "road.half_width=40", "scan.platform.lateral_offsets=[5]"]
SMALL += ["scan.lines_per_second=50", "scan.platform.speed=24", "colour.source=material"]


def job(output: Path, *changes: str, **options) -> Job:
    return Job(load_scenario("rq31-600m-even", [*SMALL, *changes]), output, **options)


def command(*arguments: str | Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "headless.generate", *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        stdin=subprocess.DEVNULL,
    )


@pytest.mark.any_blender
def test_a_road_that_no_pulse_comes_back_from_is_told(tmp_path: Path) -> None:
    report = generate(job(tmp_path, "road.length=20", "scan.attenuation=1", 'outputs=["cloud"]'))
    assert report["counts"]["points"] == 0
    assert "no pulse came back" in json.loads((tmp_path / "report.json").read_text())["warnings"][0]
    assert summary(report, tmp_path).startswith("warning: no pulse came back")


@pytest.mark.any_blender
def test_the_cube_that_blender_begins_with_is_not_scanned(tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    report = generate(job(tmp_path, "road.length=20", 'outputs=["cloud"]'))
    assert "Cube" not in bpy.data.objects
    assert "unlabelled" not in report["counts"]["points_by_class"]
    assert report["counts"]["points"] > 1000


@pytest.mark.parametrize(
    ("change", "codes"), [("road.height_epsg=7837", (25832, 7837)), ("road.epsg=5555", (25832, 5783))]
)
def test_clouds_name_what_heights_are_counted_in(change: str, codes: tuple[int, int], tmp_path: Path) -> None:
    files = 'cloud.formats=["laz","ply","npz"]'
    generate(job(tmp_path, "road.length=20", change, files, 'outputs=["cloud","centerline"]'))
    for name in ("cloud.laz", "cloud.ply", "cloud.npz"):
        with open_cloud(tmp_path / name) as cloud:
            assert (cloud.header.epsg, cloud.header.height_epsg) == codes
    named = json.loads((tmp_path / "centerline.geojson").read_text())["crs"]["properties"]["name"]
    system = MapSystem.read(named)
    assert (system.epsg, system.height_epsg) == codes


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("road.height_epsg=25833", "road.height_epsg is 25833: must be the EPSG code of a vertical"),
        ("road.epsg=4326", "road.epsg is 4326: must be a projected system with coordinates in metres"),
        ("road.epsg=2225", "road.epsg is 2225: must have coordinates in metres, as EPSG:26941 has"),
        ("road.epsg=7837", "road.epsg is 7837: .*has heights only"),
    ],
)
def test_systems_that_no_road_can_be_in_are_refused(change: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        generate(job(tmp_path / "out", change))
    assert not (tmp_path / "out").exists()


def test_a_map_origin_in_another_country_is_told(tmp_path: Path) -> None:
    with logged() as messages:
        report = generate(job(tmp_path / "out", "road.length=20", "road.epsg=2056", 'outputs=["parameters"]'))
    assert ["lies outside of the area that EPSG:2056 is meant for" in message for message in messages] == [True]
    assert report["remarks"] == messages
    assert json.loads((tmp_path / "out/report.json").read_text())["remarks"] == messages


def test_a_report_has_the_remarks_of_its_own_job_alone(tmp_path: Path) -> None:
    reports = []
    for number, change in enumerate(("road.epsg=2056", "road.epsg=25832")):
        reports.append(generate(job(tmp_path / str(number), "road.length=20", change, 'outputs=["parameters"]')))
    assert [len(report["remarks"]) for report in reports] == [1, 0]


def test_every_file_is_written_and_agrees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("synthroads_addon.cloud.tools.previews.WIDTH", 300)
    seen = []
    report = generate(job(tmp_path), lambda stage, share: seen.append((stage, share)))
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [name for names in FILES.values() for name in names] + ["report.json"]
    )
    assert json.loads((tmp_path / "report.json").read_text()) == json.loads(json.dumps(report))
    las = laspy.read(tmp_path / "cloud.laz")
    assert len(las) == report["counts"]["points"] > 50_000
    parameters = read_parameters(tmp_path / "parameters.json")
    names = [InstanceNumbers(parameters).name_of(number) for number in np.unique(las.instance_id).tolist()]
    assert {str(name).partition("/")[0] for name in names} <= set(parameters.objects)
    assert any("/dash-" in str(name) for name in names)
    assert report["instances"]["parts"].keys() >= {str(name).partition("/")[0] for name in names if "/" in str(name)}
    line = json.loads((tmp_path / "centerline.geojson").read_text())["features"][0]
    ends = np.array(line["geometry"]["coordinates"])[[0, -1]]
    assert np.linalg.norm(np.diff(ends[:, :2], axis=0)) == pytest.approx(120, abs=1)
    assert line["properties"]["length"] == 120
    assert ("scan", 1.0) in seen


@pytest.mark.any_blender
def test_only_what_is_asked_for_is_made(tmp_path: Path) -> None:
    report = generate(job(tmp_path, 'outputs=["parameters"]'))
    assert list(report["stages"]) == ["parameters"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["parameters.json", "report.json"]


@pytest.mark.any_blender
def test_same_seed_same_bytes_whatever_the_threads(tmp_path: Path) -> None:
    for name, changes in {"a": ["scan.threads=1"], "b": ["scan.threads=3"], "c": ["seed=2"]}.items():
        generate(job(tmp_path / name, 'outputs=["parameters","cloud"]', "road.length=60", *changes))
    for file in ("parameters.json", "cloud.laz"):
        a, b, c = ((tmp_path / name / file).read_bytes() for name in "abc")
        assert a == b
        assert a != c


@pytest.mark.any_blender
def test_a_written_set_gives_the_same_road_again(tmp_path: Path) -> None:
    generate(job(tmp_path / "a", 'outputs=["parameters"]'))
    again = job(tmp_path / "b", 'outputs=["parameters"]', parameters=tmp_path / "a" / "parameters.json")
    generate(again)
    assert (tmp_path / "a/parameters.json").read_bytes() == (tmp_path / "b/parameters.json").read_bytes()


@pytest.fixture(scope="module")
def demo():
    """A third of the demo scene at standard fidelity: scenario, geometry and what is scanned."""
    from synthroads_addon.blender.model.build import build_road
    from synthroads_addon.blender.scene.evaluated import scanned_scene
    from synthroads_addon.blender.things.model_builder import BuildRequest
    from synthroads_addon.sampling.road import sample_road

    scenario = load_scenario("rq31-600m-even", ["road.length=200", "scan.noise.range_sigma=0", "scan.rays_per_pulse=1"])
    parameters = sample_road(scenario.road, scenario.seed)
    build_road(BuildRequest(parameters, scenario.settings().tolerance, 0.3))
    geometry = RoadGeometry(parameters)
    return scenario, geometry, scanned_scene(geometry=geometry)


def scan_of(scenario, geometry, scene):
    return Site.of_road(scenario, geometry, ScenarioInputs.read(scenario)).plan(scene, BlenderServices())


@pytest.mark.keep_scene
@pytest.mark.parametrize(("name", "driven"), [("mobile-mapping-300m-even", True), ("rq31-600m-even", False)])
def test_a_vehicle_carries_the_scanner_where_the_platform_is_one(demo, name: str, driven: bool) -> None:
    _, geometry, scene = demo
    assert scan_of(load_scenario(name), geometry, scene).emission.on_vehicle is driven


@pytest.mark.keep_scene
@pytest.mark.parametrize(("sigma", "rays"), [(0.0, 1), pytest.param(0.01, 1, marks=pytest.mark.any_blender)])
def test_labels_of_the_pavement_agree_with_the_parameters(demo, sigma: float, rays: int) -> None:
    """99.9 % of the pavement's points lie in a strip of their class within 2 cm (+ three sigma with noise)."""
    scenario, geometry, scene = demo
    changed = scenario.scan.model_copy(update={"noise": scenario.scan.noise.model_copy(update={"range_sigma": sigma})})
    scan = scan_of(scenario.model_copy(update={"scan": changed}), geometry, scene)
    points = concatenate([scan_block(scan, *task).points for task in list(scan.blocks())[::10]])
    wrong = misplaced_points(points, geometry, 0.02 + 3 * sigma)
    print(f"{wrong.mean():.4%} of {len(wrong)} points of the pavement lie outside the strips of their class")
    assert len(wrong) > 50_000
    assert wrong.mean() < 0.001
    swapped = replace(points, class_id=np.where(points.class_id == 1, 2, points.class_id).astype(np.uint8))
    assert misplaced_points(swapped, geometry, 0.02 + 3 * sigma).mean() > 0.5  # the check can fail


@pytest.mark.keep_scene
def test_points_of_the_road_lie_on_the_analytic_surface(demo) -> None:
    scenario, geometry, scene = demo
    scan = scan_of(scenario, geometry, scene)
    points = concatenate([scan_block(scan, *task).points for task in list(scan.blocks())[::9]])
    road = points.select(points.class_id == 1)
    local = road.xyz - scene.static.origin
    station, offset = geometry.alignment.project(local[:, :2])
    error = local[:, 2] - geometry.elevation(station, offset)
    error = error[np.isfinite(error)]
    print(f"largest height error {1e3 * np.abs(error).max():.2f} mm over {len(error)} points")
    assert len(error) > 50_000
    assert np.abs(error).max() <= scenario.settings().tolerance


@pytest.mark.any_blender
@pytest.mark.keep_scene
def test_casters_agree(demo) -> None:
    """Same face for 99.99 % of 10,000 rays with ranges within 0.1 mm; every other ray passes an edge that closely."""
    from synthroads_addon.blender.casters import make_caster
    from synthroads_addon.scanning.scene.caster import FacePlanes

    scenario, geometry, scene = demo
    mesh, scan = scene.static, scan_of(scenario, geometry, scene)
    rng = np.random.default_rng(5)
    rays = []
    per_second = scan.setting.pulses_per_line * scan.setting.lines_per_second
    for strip in scan.path.strips:
        begin, end = strip.start_time, strip.start_time + strip.duration
        firsts = rng.integers(0, int(strip.duration * per_second) - 1000, 5)
        rays += [emit_pulses(scan, strip, begin, end, int(first), 1000) for first in firsts]
    origins = np.concatenate([p.origin.T for p in rays])
    directions = np.concatenate([p.direction.T for p in rays])
    hits = {}
    for name in ("bvhtree", "embree"):
        caster = make_caster(name, mesh)
        assert caster.name == name
        hits[name] = caster.cast(origins.astype(np.float32), directions.astype(np.float32), 500.0)
    a, b = hits["bvhtree"], hits["embree"]
    assert len(a) == 10_000
    assert (a >= 0).mean() > 0.5
    same = a == b
    other = np.flatnonzero(~same)
    both = same & (a >= 0)
    planes = FacePlanes(mesh)
    ranges = {n: planes.intersect(h[both], origins[both].T, directions[both].T)[0] for n, h in hits.items()}
    assert np.abs(ranges["bvhtree"] - ranges["embree"]).max() == 0.0  # one face, one plane: the same float64 range
    near = [
        min(edge_distance(mesh, face, origins[i], directions[i]) for face in (a[i], b[i]) if face >= 0) for i in other
    ]
    print(f"same face {same.mean():.6%}, {len(other)} others pass edges within {max(near, default=0):.2e} m")
    assert same.mean() >= 0.9999
    assert max(near, default=0.0) <= 1e-4


def edge_distance(mesh, face: int, origin: np.ndarray, direction: np.ndarray) -> float:
    """Return the smallest distance between a ray and the edges of a face."""
    corners = mesh.vertices[mesh.triangles[face]].astype(float)
    distances = []
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = q - p
        normal = np.cross(direction, edge)
        t = np.linalg.lstsq(np.stack([direction, -edge], axis=1), p - origin, rcond=None)[0]
        if 0 <= t[1] <= 1 and np.linalg.norm(normal) > 0:
            distances.append(abs((p - origin) @ normal) / np.linalg.norm(normal))
        along = (p - origin) @ direction
        distances.append(float(np.linalg.norm(p - origin - along * direction)))
    return min(distances)


@pytest.mark.slow
@pytest.mark.any_blender
@pytest.mark.skipif(not REAL_AXIS.exists(), reason="needs the real axis beside the checkout")
def test_a_real_axis_is_met_and_scanned(tmp_path: Path) -> None:
    """Made axes are met in tests/fitting."""
    fast = ("vegetation_detail=0", "scan.platform.speed=40", "scan.lines_per_second=20")
    report = generate(job(tmp_path, *fast, 'outputs=["parameters","cloud","centerline"]', axis=REAL_AXIS))
    fit = report["axis"]["horizontal"]
    assert fit["rms"] <= 0.05
    assert fit["p95"] <= 0.10
    assert report["counts"]["points"] > 40_000
    parameters = read_parameters(tmp_path / "parameters.json")
    given = np.genfromtxt(REAL_AXIS, delimiter=",", names=True)
    geometry = RoadGeometry(parameters)
    local = np.column_stack([given["x"], given["y"]]) - np.array(parameters.transform.translate)[:2]
    offset = geometry.alignment.project(local)[1]
    assert np.sqrt(np.mean(offset**2)) <= 0.05
    assert np.quantile(np.abs(offset), 0.95) <= 0.10
    assert np.abs(offset).max() == pytest.approx(fit["worst"], abs=2e-3)


@pytest.mark.any_blender
def test_cancelling_leaves_nothing(tmp_path: Path) -> None:
    def stop(stage: str, share: float) -> None:
        if stage == "scan" and share > 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate(job(tmp_path / "out"), stop)
    assert list(tmp_path.iterdir()) == []


FILES_OF_BAD_INPUTS = {
    "nan.json": '{"type": "Scenario", "road": {"length": NaN}}',
    "key.json": '{"type": "Scenario", "raod": {}}',
    "point.csv": "x,y,z\n1,2,3\n",
    "nan.csv": "x,y,z\n1,2,3\n2,nan,3\n3,4,5\n",
    "set.json": '{"type": "RoadParameters", "version": "1.0"}',
    "file": "",
}
BAD_INPUTS = {
    "missing scenario": ("--scenario {}/no.json", "no.json"),
    "unknown scenario": ("--scenario rq31-600", "did you mean 'rq31-600m'"),
    "unknown key": ("--scenario {}/key.json", "'raod' (did you mean 'road'?)"),
    "NaN": ("--scenario {}/nan.json", "NaN"),
    "negative width": ("--set road.half_width=-3", "road.half_width is -3"),
    "unknown field": ("--set road.widht=3", "widht"),
    "bad --set": ("--set road.length", "path=value"),
    "missing axis": ("--axis {}/no.csv", "no.csv"),
    "axis of one point": ("--axis {}/point.csv", "point.csv"),
    "NaN in axis": ("--axis {}/nan.csv", "nan.csv"),
    "missing set": ("--parameters {}/none.json", "none.json"),
    "incomplete set": ("--parameters {}/set.json", "set.json: metadata"),
    "file for folder": ("--output {}/file/out", "--output"),
    "no such fidelity": ("--fidelity best", "--fidelity"),
    "seed": ("--seed -1", "--seed"),
    "device": ("--set scan.device=rigel", "scan.device"),
    "epsg": ("--set road.epsg=99999", "epsg"),
}
"""Wrong command lines, {} being a folder of their own, and what their one line must name."""


@pytest.mark.any_blender
@pytest.mark.parametrize("name", BAD_INPUTS)
def test_wrong_input_is_one_line_and_exit_code_2(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    for file, text in FILES_OF_BAD_INPUTS.items():
        (tmp_path / file).write_text(text)
    line, named = BAD_INPUTS[name]
    output = [] if "--output" in line else ["--output", str(tmp_path / "out")]
    try:
        code = commands.command("generate", [*line.format(tmp_path).split(), *output])
    except SystemExit as stop:
        code = stop.code
    said = capfd.readouterr().err
    assert code == 2, said
    lines = said.strip().splitlines()
    assert len(lines) == 1, said
    assert named in lines[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.any_blender
def test_output_already_there_needs_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = [part for change in [*SMALL, 'outputs=["parameters"]'] for part in ("--set", change)]
    assert commands.command("generate", ["--output", str(tmp_path), *small]) == 0
    capsys.readouterr()
    assert commands.command("generate", ["--output", str(tmp_path), *small]) == 2
    assert "--overwrite" in capsys.readouterr().err
    json_run = command("--output", tmp_path, *small, "--overwrite", "--json")
    assert json_run.returncode == 0
    assert json.loads(json_run.stdout)["type"] == "Report"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_no_write_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    result = command("--output", tmp_path / "out")
    assert result.returncode == 2
    assert "ermission" in result.stderr


@pytest.mark.any_blender
def test_a_device_out_of_its_limits_is_refused_before_work(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"scan\.lines_per_second"):
        generate(job(tmp_path / "out", "scan.lines_per_second=500"))
    assert not (tmp_path / "out").exists()
