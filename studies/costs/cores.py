"""Measure a scan by the cores that it may use, on a machine that needs no Blender: a table of docs/benchmark.md.

    python studies/costs/cores.py save out/scene.pickle [--scenario NAME] [--set FIELD=VALUE ...]
    python studies/costs/cores.py scan out/scene.pickle --cores 1 2 4 8 16

The first command, in Blender, makes the scene and keeps it in a file; the second reads it wherever Embree, NumPy and
laspy are, and scans it in a process of its own for each number of cores, with packets of rays, compiled loops, and
colours and layers of the materials. The numbers of cores are measured in turn, ``--turns`` times; of each the fastest
scan counts, as other work only slows. The file is a pickle: read none but your own.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import json
import pickle  # nosec B403 # one's own file, as the docstring says
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.base.machine import available_cores, cores_of_children
from synthroads_addon.base.progress import StageTimer, peak_memory_mb
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.materials.table import Material
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.colour.colour import LayerSource, surface_constants
from synthroads_addon.scanning.colour.request import LayerRequest, material_layers
from synthroads_addon.scanning.colour.transparency import Transparency
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.packets import Packets, PacketScene, usable_packets
from synthroads_addon.scanning.relief.normal_images import NormalImage
from synthroads_addon.scanning.scene.caster import Caster
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario, load_scenario

SETTINGS = ("colour.source=material", 'outputs=["cloud"]')


class KeptScene(NamedTuple):
    """A scene in a file, with what a scan asks of Blender besides.

    Attributes:
        scenario, road: as JSON data.
        scene: what is scanned.
        materials: mean properties by the scene's materials.
    """

    scenario: dict[str, Any]
    road: dict[str, Any]
    scene: ScannedScene
    materials: dict[str, Material]


class KeptCaster(PacketScene):
    """Caster of packets of rays at a mesh, without Blender."""

    name = "embree"
    main_thread_only = False

    def __init__(self, packets: Packets, mesh: SceneMesh) -> None:
        super().__init__(packets, mesh.vertices, mesh.triangles)
        self.kernels = f"packets of {packets.width} rays"


class KeptServices:
    """Services of a scan without Blender: Embree's packets, and the means of the materials."""

    def __init__(self, kept_scene: KeptScene, packets: Packets) -> None:
        self._rows, self._packets = kept_scene.materials, packets

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        """Return the caster of packets over a mesh, whatever its name."""
        return KeptCaster(self._packets, mesh)

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean optical properties of materials by name."""
        return [self._rows[name] for name in names]

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return that no layer varies: the means are all there is."""
        return False

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        """Return that no material has a normal image."""
        return {}

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        """Return that no material is clear in places."""
        return {}

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Return the context of the means as the points' layers."""
        rows = self.materials(request.mesh.materials)
        return nullcontext(material_layers(request, surface_constants(rows)))


def save(path: Path, scenario: Scenario) -> None:
    """Build a scenario's road in Blender and write its scene to a file."""
    from synthroads_addon.blender.files import empty_file
    from synthroads_addon.blender.materials import constants
    from synthroads_addon.jobs.open_scene import RoadScene
    from synthroads_addon.sampling.road import sample_road

    empty_file()
    parameters = sample_road(scenario.road, scenario.seed)
    road_scene = RoadScene.of(scenario, RoadGeometry(parameters))
    road_scene.build()
    scene = road_scene.read()
    kept_scene = KeptScene(scenario.to_dict(), parameters.to_dict(), scene, constants(scene.static.materials))
    path.parent.mkdir(parents=True, exist_ok=True)
    with gzip.open(path, "wb", compresslevel=3) as file:
        pickle.dump(tuple(kept_scene), file)
    print(f"{path}: {len(scene.static):,} triangles, {path.stat().st_size / 1e6:.1f} MB")


def scan(path: Path) -> dict[str, Any]:
    """Scan a kept scene with all cores that this process may use; return what it took, as JSON data.

    Returns:
        ``seconds`` from the first pulse to the file's end, by the clock; ``processor_seconds`` of all threads, with the
        caster's tree; ``kernels``, ``points``, ``memory_mb``, ``stages``; ``sha256`` of the cloud.
    """
    packets = usable_packets()
    if isinstance(packets, NoKernelError):
        raise SystemExit(f"rays can't be cast in packets, as {packets}: python tools/build_kernels.py")
    with gzip.open(path, "rb") as file:
        kept_scene = KeptScene(*pickle.load(file))  # nosec B301 # as above
    scenario, timer = Scenario.from_dict(kept_scene.scenario), StageTimer()
    geometry = RoadGeometry(RoadParameters.from_dict(kept_scene.road))
    processor = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        site = Site.of_road(scenario, geometry, ScenarioInputs.read(scenario))
        counts = site.scan(kept_scene.scene, KeptServices(kept_scene, packets), Path(folder), timer)
        processor_seconds = time.process_time() - processor
        cloud_digest = hashlib.sha256((Path(folder) / "cloud.laz").read_bytes()).hexdigest()
    return {
        "cores": available_cores(),
        "seconds": sum(timer.stages[name]["seconds"] or 0.0 for name in ("scan", "files")),
        "processor_seconds": processor_seconds,
        "kernels": counts["kernels"],
        "points": counts["points"],
        "memory_mb": peak_memory_mb(),
        "stages": timer.stages,
        "sha256": cloud_digest,
    }


def in_process(path: Path, cores: int) -> dict[str, Any]:
    """Scan a kept scene in a new process that may use so many cores; return what `scan` does."""
    with cores_of_children(cores):
        process = subprocess.run(
            [sys.executable, __file__, "scan", str(path)], check=True, capture_output=True, text=True
        )
    result: dict[str, Any] = json.loads(process.stdout)
    return result


def _seconds(run: dict[str, Any]) -> float:
    """Return a run's seconds."""
    return float(run["seconds"])


def main() -> None:
    """Save a scene, or scan one and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("save", "scan"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--scenario", default="rq31-600m-even")
    parser.add_argument("--set", dest="changes", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--cores", nargs="+", type=int, default=[])
    parser.add_argument("--turns", type=int, default=1, metavar="N", help="times that each number is measured (1)")
    arguments = parser.parse_args()
    if arguments.what == "save":
        save(arguments.file, load_scenario(arguments.scenario, [*SETTINGS, *arguments.changes]))
        return
    if not arguments.cores:
        print(json.dumps(scan(arguments.file)))
        return
    runs = [in_process(arguments.file, cores) for _ in range(arguments.turns) for cores in arguments.cores]
    fastest_runs = [min(runs[number :: len(arguments.cores)], key=_seconds) for number in range(len(arguments.cores))]
    run_of_cores = dict(zip(arguments.cores, fastest_runs, strict=True))
    first_run = run_of_cores[arguments.cores[0]]
    print("| cores | scan, s | processor time, s | million points/s | against one core | memory, MB | the same bytes |")
    print("|---|---|---|---|---|---|---|")
    for cores, run in run_of_cores.items():
        rate, gain = run["points"] / run["seconds"] / 1e6, first_run["seconds"] / run["seconds"]
        has_same_bytes = "yes" if run["sha256"] == first_run["sha256"] else "NO"
        memory = f"{run['memory_mb']:,.0f}"
        cells = [f"{cores}", f"{run['seconds']:.1f}", f"{run['processor_seconds']:.1f}", f"{rate:.2f}", f"{gain:.2f}"]
        print(f"| {' | '.join([*cells, memory, has_same_bytes])} |", flush=True)
    print(json.dumps(runs), file=sys.stderr)


if __name__ == "__main__":
    main()
