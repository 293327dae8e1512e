"""Scans of two meshes, waves and a road, that are measured beside Embree alone and beside another version."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

from ..base.changes import apply_change
from ..base.progress import StageTimer, peak_memory_mb
from ..scenario.scenario import Scenario, load_scenario
from .measure.waves import write_obj

_PLAIN = ("scan.relief=0", "colour.source=material", 'cloud.formats=["las"]', 'outputs=["cloud"]')
_WAVES = (*_PLAIN, "scan.device=generic-polygon", "scan.platform.height=80")
"""Changes of a scenario for a scan of the waves; one of `_SLOW`, `_MIDDLE` and `_FAST` belongs to it."""
_ROAD = (
    *_PLAIN, "scan.device=riegl-minivux-3uav", "scan.pulse_rate_khz=200", "scan.field_of_view_deg=180",
    "scan.lines_per_second=100", "scan.platform.height=60", "scan.platform.speed=8",
)  # fmt: skip
"""Changes of a scenario for a scan of the road."""
_SLOW, _MIDDLE, _FAST = (f"scan.platform.speed={speed}" for speed in (2, 10, 100))
"""Of the waves 5 million pulses, 1 million, and a tenth of that."""
_RAYS = {"waves": (1, 19), "road": (1, 7, 19)}
"""Numbers of rays per pulse that each mesh is scanned with."""
_ROAD_LENGTH = "road.length=100"
_QUICK_ROAD = ("road.length=20", "road.half_width=20", "fidelity=draft")


def scans_beside(parts: Collection[str], is_quick: bool) -> list[tuple[str, str, tuple[str, ...]]]:
    """Return the scans that two versions do in turn: name of the line, mesh, changes of the scenario.

    Args:
        parts: of `synthroads benchmark` that are measured.
        is_quick: whether fewer pulses do, as it is only to be seen that all works.
    """
    scans = []
    for mesh, changes in (("waves", _WAVES), ("road", _ROAD)):
        for rays in _RAYS[mesh] if mesh in parts else ():
            row_changes: tuple[str, ...] = (f"scan.rays_per_pulse={rays}",)
            if mesh == "waves":
                row_changes += (_FAST if is_quick else _SLOW if rays == 1 else _MIDDLE,)
            scans.append((f"{mesh}_{rays}", mesh, (*changes, *row_changes)))
    if "start" in parts:
        scans.append(("start", "start", (*_WAVES, _FAST)))
    return scans


def write_road(path: Path, is_quick: bool) -> None:
    """Write the road's mesh as an .obj file with z up; a short one where it is only to be seen that all works."""
    from .measure.scenes import road_mesh  # Blender is started by what builds or scans alone

    mesh = road_mesh(load_scenario("rq31-600m", [_ROAD_LENGTH, *(_QUICK_ROAD if is_quick else ())]))
    write_obj(path, mesh.vertices, mesh.triangles)


def measure_mesh_scans(name: str, file: Path, is_quick: bool) -> dict[str, Any]:
    """Scan a mesh with each number of rays per pulse, beside Embree alone.

    Args:
        name: ``waves`` or ``road``.
        file: the mesh, an .obj with z up.
        is_quick: whether fewer pulses do, as it is only to be seen that all works.

    Returns:
        ``lines``: figures by the names of `headless.benchmark_table.LIMITS`; ``floors``: rates beside Embree's;
        ``scans``: million pulses per second by the clock, million rays per processor second, and the share of the
        cores' time that was used.
    """
    from .measure.scenes import measure_scene
    from .scan_scene import SceneScan, check_scene_scan, open_and_read, scene_site  # likewise

    data: Any = Scenario().to_dict()
    for change in _ROAD if name == "road" else (*_WAVES, _FAST if is_quick else _SLOW):
        data = apply_change(data, change, Scenario)
    job = SceneScan(Scenario.from_dict(data), Path("out"), file, up="z")
    memory_before, timer = peak_memory_mb() or 0.0, StageTimer()
    inputs = check_scene_scan(job)
    scene, road, _ = open_and_read(job, inputs, timer, {})
    figures = measure_scene(scene_site(job, inputs, scene.static, road), scene, file, name, _RAYS[name], timer)
    packet_rates = {rays: rate.get("packets", rate["single rays"]) for rays, rate in figures["rates"].items()}
    lines = {f"{name}_{rays}": 100.0 * rate["ours"] / packet_rates[rays] for rays, rate in figures["rates"].items()}
    scans = {
        f"{name}_{rays}": {
            "pulses_per_second": rate["pulses_per_second"],
            "processor_rate": rate["ours"],
            "busy": rate["busy"],
        }
        for rays, rate in figures["rates"].items()
    }
    if name == "waves":
        memory = 1e6 * (figures["memory_mb"] - memory_before) / len(scene.static)
        lines |= {"waves_memory": memory, "waves_opening": figures["opening"], "waves_fixed": figures["fixed"]}
    return {"lines": lines, "floors": figures["floors"], "scans": scans}
