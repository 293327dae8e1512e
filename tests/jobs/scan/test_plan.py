"""A scenario resolved into a plan and recorded, with stand-ins for Blender: exact hits on a plane, its own colour."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.jobs.scan.parts import Survey
from synthroads_addon.jobs.scan.plan import plan_scan
from synthroads_addon.materials.table import Material, materials
from synthroads_addon.road.surroundings import Environment
from synthroads_addon.scanning.colour.colour import LayerSource, MaterialLayers, surface_constants
from synthroads_addon.scanning.colour.request import LayerRequest
from synthroads_addon.scanning.colour.transparency import Transparency
from synthroads_addon.scanning.parts.conditions import ScanConditions
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scanning.relief.normal_images import NormalImage
from synthroads_addon.scanning.scene.caster import Caster
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.weather.registry import WEATHERS
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.scan_scenes import BruteForce, Standing, plane

ROOT = Path(__file__).resolve().parents[3]


class StandIns:
    """Services without Blender: rays tested against every face, layers as the table of materials has them.

    Attributes:
        asked: what was asked for, in turn.
    """

    def __init__(self) -> None:
        self.asked: list[Any] = []

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        self.asked.append(("caster", name, kernels))
        return BruteForce(mesh)

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        return False

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        return {}

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        return {}

    def materials(self, names: Sequence[str]) -> list[Material]:
        return [materials()[name] for name in names]

    @contextmanager
    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> Iterator[LayerSource]:
        self.asked.append(("layers", request.names, request.settings.image_spacing))
        progress(1.0)
        yield MaterialLayers(surface_constants(self.materials(request.mesh.materials)))


def planned(
    services: StandIns, conditions: ScanConditions | None = None, seconds: float = 0.02, **changes: Any
) -> ScanPlan:
    """Return the plan of a short scan over a plane at z = 0, from 60 m above."""
    path = Standing()
    path.strips = (type(path.strips[0])(0, 0.0, seconds),)  # type: ignore[misc]
    scan = {"noise": {"range_sigma": 0.0}, "relief": 0.0, "caster": "embree"} | changes.pop("scan", {})
    scenario = Scenario.from_dict({"fidelity": "draft", "scan": scan} | changes)
    return plan_scan(
        Survey(scenario, ScenarioInputs.read(scenario), services, conditions or ScanConditions()),
        ScannedScene(plane()),
        path,
    )


def recorded(plan: ScanPlan) -> PointBlock:
    """Return the points of a plan's only block."""
    blocks = CollectedBlocks()
    record(plan, blocks)
    (result,) = blocks.results
    return result.points


def test_every_default_is_filled_in_once() -> None:
    services = StandIns()
    foggy = ScanConditions(Environment(weather="fog", visibility=500.0))
    plan = planned(services, foggy)
    device = plan.setting.device
    assert (plan.emission.rings, plan.relief.octaves) == ((), 2), "the draft fidelity's"
    assert plan.setting.pulse_rate == device.modes[0].pulse_rate_khz * 1e3
    fog = WEATHERS["fog"].from_dict({"condition": "fog", "visibility": 500.0})
    assert plan.atmosphere.attenuation == fog.attenuation(device.wavelength_nm)
    assert planned(services, foggy, scan={"attenuation": 0.01}).atmosphere.attenuation == 0.01
    assert not plan.emission.on_vehicle
    assert planned(services, scan={"platform": {"kind": "vehicle"}}).emission.on_vehicle
    with pytest.raises(AttributeError):
        plan.run.seed = 2  # type: ignore[misc]


def test_the_effects_of_the_weather_are_in_the_plan_unless_an_attenuation_is_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    effect = object()
    monkeypatch.setattr(WEATHERS["rain"], "effects", lambda weather: (effect, weather))
    rain = {"condition": "rain", "visibility": 900.0}
    assert planned(StandIns(), scan={"weather": rain}).atmosphere.effects == (effect, WEATHERS["rain"].from_dict(rain))
    wet = ScanConditions(Environment(weather="rain", visibility=900.0))
    assert planned(StandIns(), wet).atmosphere.effects == (effect, WEATHERS["rain"].from_dict(rain)), "that of the road"
    assert planned(StandIns(), wet, scan={"attenuation": 0.01}).atmosphere.effects == ()


def test_it_asks_the_services_for_what_the_scenario_wants() -> None:
    services = StandIns()
    points = recorded(planned(services, cloud={"attributes": ["normal", "noise_free", "roughness"]}))
    ((_, name, kernels), (_, wanted, spacing)) = services.asked
    assert (name, kernels, wanted) == ("embree", "auto", {"rgb", "roughness"})
    assert spacing == Scenario.from_dict({"fidelity": "draft"}).colour.settings("draft", 60.0).image_spacing
    assert len(points) > 100
    assert np.allclose(points.xyz[:, 2], 180.0, atol=1e-4), "every point lies on the plane"
    assert np.allclose(points.array("normal"), [0.0, 0.0, 1.0])
    table = materials()["asphalt"]
    assert np.allclose(points.array("roughness"), table.roughness, atol=1e-6)
    assert points.rgb.any()
    assert len(np.unique(points.rgb, axis=0)) == 1


def test_nothing_is_asked_for_that_nobody_wants() -> None:
    services = StandIns()
    points = recorded(planned(services, colour={"rgb": False}, cloud={"attributes": []}))
    assert [asked[:2] for asked in services.asked] == [("caster", "embree"), ("layers", frozenset())]
    assert not points.rgb.any()
    assert not points.more


def scan_without_blender() -> None:
    """Plan and record a scan where importing Blender fails; for a process of its own."""
    sys.modules |= dict.fromkeys(("bpy", "bmesh", "mathutils", "gpu"))
    services = StandIns()
    points = recorded(planned(services, colour={"rgb": False}, cloud={"attributes": ["normal", "roughness"]}))
    assert np.allclose(points.xyz[:, 2], 180.0, atol=1e-4), "every point lies on the plane"
    assert [asked[0] for asked in services.asked] == ["caster", "layers"]


def test_none_of_it_needs_blender() -> None:
    program = "import tests.jobs.scan.test_plan as of; of.scan_without_blender()"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
