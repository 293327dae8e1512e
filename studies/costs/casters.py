"""Measure the ray casters on the same rays: rays per second, memory, building, agreement. Prints the tables of docs.

    python studies/costs/casters.py [--scene demo|waves] [--rays N]
    python studies/costs/casters.py --packets [--scene demo|waves] [--rays N]

Every row is a process of its own, so that its memory is its own. Rates are by the clock and, in brackets, per second
of processor time of all cores together, which other work on the machine hardly touches. With --packets only Embree's
packets and its single rays are measured, in turn in one process, by one thread's time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import bpy  # noqa: F401  # mathutils comes with it
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from studies.costs.raycast_nodes import RaycastNodesCaster
from synthroads_addon.base.progress import peak_memory_mb
from synthroads_addon.base.random_streams import stream
from synthroads_addon.blender.casters.bvhtree import BVHTreeCaster
from synthroads_addon.blender.casters.embree import EmbreeCaster
from synthroads_addon.blender.casters.measure import CHUNK, agreement, bare_rate
from synthroads_addon.blender.casters.packets import PacketCaster
from synthroads_addon.jobs.measure.waves import wave_mesh
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.packets import usable_packets
from synthroads_addon.scanning.scene.caster import Caster
from synthroads_addon.scanning.scene.mesh import SceneMesh

REFERENCE = "bvhtree"
THREADED = ("embree", "embree, single rays")
CHUNKS = (2**12, 2**14, 2**16, 2**18, 2**20)
RANGE = 200.0
ANGLE_STEP_DEG, LINE_SPACING, LINES_TOGETHER = 0.18, 0.08, 20
"""miniVUX-3UAV at 200 kHz and 100 lines/s, flown at 8 m/s; groups of lines, each as dense as in a survey."""
DIVERGENCE_MRAD, RAYS_PER_PULSE = (1.6, 0.5), 7
PAIRS = 7
"""Times that packets and single rays are cast in turn."""


def packet_caster(mesh: SceneMesh) -> PacketCaster:
    """Return Embree's caster that casts packets, which has to be usable here."""
    packets = usable_packets()
    if isinstance(packets, NoKernelError):
        raise SystemExit(f"packets can't be measured: {packets}")
    return PacketCaster(packets, mesh)


Flight: TypeAlias = tuple[NDArray[np.float64], float, float]
"""The axis (N, 3) below the path, the height above it (m), and half of the field of view (rad)."""


CASTERS: dict[str, Callable[[SceneMesh], Caster]] = {
    "bvhtree": BVHTreeCaster,
    "raycast nodes": RaycastNodesCaster,
    "embree": packet_caster,
    "embree, single rays": EmbreeCaster,
    "embree, single rays, not robust": lambda mesh: EmbreeCaster(mesh, robust=False),
}


def demo_scene() -> tuple[SceneMesh, Flight]:
    """Build the scenario `rq31-600m-even`; return its mesh, and the flight over it."""
    from synthroads_addon.blender.files import empty_file
    from synthroads_addon.blender.model.build import build_road
    from synthroads_addon.blender.scene.evaluated import scene_mesh
    from synthroads_addon.blender.things.model_builder import BuildRequest
    from synthroads_addon.road.geometry import RoadGeometry
    from synthroads_addon.sampling.road import sample_road
    from synthroads_addon.scenario.scenario import load_scenario

    empty_file()
    scenario = load_scenario("rq31-600m-even")
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    build_road(BuildRequest(parameters, scenario.settings().tolerance, scenario.settings().vegetation_detail))
    station = np.arange(0.0, geometry.length, LINE_SPACING)
    axis = np.column_stack([geometry.alignment.frame(station)[0], geometry.profile.elevation(station)])
    return scene_mesh(), (axis, 60.0, float(np.deg2rad(52.0)))


def waves_scene() -> tuple[SceneMesh, Flight]:
    """Return a mesh of 2 million triangles over 100 m x 100 m, z = 0.2 sin x cos y, and the flight over it."""
    vertices, triangles = wave_mesh()
    mesh = bare_mesh(vertices, triangles)
    station = np.arange(-40.0, 40.0, LINE_SPACING)
    # Askew to the grid: rays that run along its lines would tell nothing but which face owns an edge.
    return mesh, (np.column_stack([station, 0.1 * station, 0.0 * station]), 80.0, float(np.deg2rad(30.0)))


SCENES: dict[str, Callable[[], tuple[SceneMesh, Flight]]] = {"demo": demo_scene, "waves": waves_scene}


def bare_mesh(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> SceneMesh:
    """Return a scene mesh of vertices (V, 3) and triangles (T, 3) with zero labels and an unknown material."""
    count = len(triangles)
    labels = (np.zeros(count, np.uint8), np.zeros(count, np.uint32), np.zeros(count, np.uint16))
    return SceneMesh(vertices, triangles, *labels, materials=("unknown",), origin=np.zeros(3))


def survey_rays(
    flight: Flight, count: int, per_pulse: int = RAYS_PER_PULSE
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return origins and directions (count, 3) of rays in the order of a UAV's survey, those of a pulse together."""
    axis, height, half_angle = flight
    angle = np.arange(-half_angle, half_angle, np.deg2rad(ANGLE_STEP_DEG))
    groups = -(-count // (per_pulse * len(angle) * LINES_TOGETHER))
    begin = np.linspace(0, len(axis) - 1 - LINES_TOGETHER, groups).astype(int)
    line = (begin[:, None] + np.arange(LINES_TOGETHER)).ravel()
    forward = axis[line + 1] - axis[line]
    forward /= np.linalg.norm(forward, axis=1)[:, None]
    rightward = np.cross(forward, [0.0, 0.0, 1.0])
    ring_angles = np.linspace(0.0, 2.0 * np.pi, per_pulse, endpoint=False)[None, None, :]
    across = angle[None, :, None] + DIVERGENCE_MRAD[0] / 4e3 * np.cos(ring_angles)
    along_angles = DIVERGENCE_MRAD[1] / 4e3 * np.sin(ring_angles) + 0.0 * across
    vertical = -np.cos(across)
    directions = (
        np.sin(across)[..., None] * rightward[:, None, None]
        + along_angles[..., None] * forward[:, None, None]
        + vertical[..., None] * [0.0, 0.0, 1.0]
    )
    directions /= np.linalg.norm(directions, axis=-1)[..., None]
    origins = np.broadcast_to((axis[line] + [0.0, 0.0, height])[:, None, None], directions.shape)
    rays = [array.reshape(-1, 3)[:count].astype(np.float32) for array in (origins, directions)]
    return rays[0], rays[1]


def measure(caster_name: str, files: Path) -> dict[str, Any]:
    """Measure one caster on the mesh and rays in a folder, saving its faces there; return the rates as JSON data."""
    mesh = bare_mesh(np.load(files / "vertices.npy"), np.load(files / "triangles.npy"))
    origins, directions = np.load(files / "origins.npy"), np.load(files / "directions.npy")
    order = stream(0, "order of rays").permutation(len(origins))
    shuffled_rays = origins[order], directions[order]
    memory_before, clock, processor = peak_memory_mb(), time.perf_counter(), time.process_time()
    caster = CASTERS[caster_name](mesh)
    faces = caster.cast(origins[:CHUNK], directions[:CHUNK], RANGE)  # Raycast builds its tree with the first rays
    row: dict[str, Any] = {
        "caster": caster_name,
        "build_seconds": time.perf_counter() - clock,
        "build_processor_seconds": time.process_time() - processor,
        "bytes_per_triangle": 1e6 * ((peak_memory_mb() or np.nan) - (memory_before or np.nan)) / len(mesh),
    }
    faces = np.concatenate([faces, caster.cast(origins[CHUNK:], directions[CHUNK:], RANGE)])
    np.save(files / f"faces {caster_name}.npy", faces)
    threads = (1, 2) if caster_name in THREADED else (1,)
    for name, rays in (("coherent", (origins, directions)), ("random", shuffled_rays)):
        row[name] = {count: vars(bare_rate(caster, *rays, RANGE, count)) for count in threads}
    if caster_name == "embree":
        row["chunks"] = {size: vars(bare_rate(caster, origins, directions, RANGE, 2, size)) for size in CHUNKS}
    return row


def compare(files: Path, row: dict[str, Any]) -> None:
    """Add the agreement of a row's caster with the reference caster, and the share of hits, to the row, in place."""
    mesh = bare_mesh(np.load(files / "vertices.npy"), np.load(files / "triangles.npy"))
    origins, directions = np.load(files / "origins.npy"), np.load(files / "directions.npy")
    caster_faces, reference_faces = (np.load(files / f"faces {name}.npy") for name in (row["caster"], REFERENCE))
    row["agreement"] = vars(agreement(mesh, origins, directions, caster_faces, reference_faces))
    row["hits"] = float((reference_faces >= 0).mean())


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the lines of two Markdown tables: casters' rates and agreement, and rates by rays per call."""
    yield (
        "| caster | threads | coherent (M rays/s) | random (M rays/s) | build (s) | memory (B/triangle) "
        "| same face (%) | the others' gap (mm) |"
    )
    yield "|---" * 8 + "|"
    for row in rows:
        for threads in row["coherent"]:
            cells = [row["caster"], "its own" if row["caster"] == "raycast nodes" else threads]
            cells += [_rate(row[name][threads]) for name in ("coherent", "random")]
            cells += [f"{row['build_seconds']:.2f}", f"{row['bytes_per_triangle']:.0f}"]
            agreement_figures = row["agreement"]
            cells += [f"{100.0 * agreement_figures['same']:.4f}", f"{1e3 * agreement_figures['gap']:.3f}"]
            yield "| " + " | ".join(cells) + " |"
    for row in rows:
        if "chunks" in row:
            yield ""
            yield "| rays per call, embree, 2 threads | " + " | ".join(f"{int(n):,}" for n in row["chunks"]) + " |"
            yield "|---" * (1 + len(row["chunks"])) + "|"
            yield "| M rays/s | " + " | ".join(_rate(rate) for rate in row["chunks"].values()) + " |"


def _rate(rate: dict[str, float]) -> str:
    """Return a rate as text: by the clock and, in brackets, by processor time."""
    return f"{rate['rays_per_second'] / 1e6:.2f} ({rate['rays_per_processor_second'] / 1e6:.2f})"


def _rows(scene: str, count: int) -> Iterator[dict[str, Any]]:
    """Yield the row of each caster, measured in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder)
        _in_own_process("--prepare", scene, files, count)
        for name in CASTERS:
            row = _in_own_process("--measure", name, files, count)
            compare(files, row)
            yield row


def _in_own_process(step: str, name: str, files: Path, count: int) -> dict[str, Any]:
    """Run a step of this program in a process of its own; return its result."""
    command = [sys.executable, __file__, step, name, "--files", str(files), "--rays", str(count)]
    result = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(result.stdout.splitlines()[-1])


def _prepare(scene: str, files: Path, count: int) -> dict[str, Any]:
    """Write the scene's mesh and its rays into a folder; return the number of triangles."""
    mesh, flight = SCENES[scene]()
    origins, directions = survey_rays(flight, count)
    arrays = {"vertices": mesh.vertices, "triangles": mesh.triangles, "origins": origins, "directions": directions}
    for name, array in arrays.items():
        np.save(files / f"{name}.npy", array)
    return {"triangles": len(mesh)}


def compare_packets(scene: str, count: int) -> None:
    """Print a table of packets beside single rays, cast in turn: millions per second of one thread's processor time."""
    mesh, flight = SCENES[scene]()
    stamps = [time.process_time()]
    packet_rays = packet_caster(mesh)
    stamps.append(time.process_time())
    single_rays = EmbreeCaster(mesh)
    stamps.append(time.process_time())
    build_times = [f"{seconds:.2f}" for seconds in np.diff(stamps)]
    print(f"\n{scene}, {len(mesh):,} triangles; built in {build_times[0]} and {build_times[1]} processor seconds\n")
    heads = ["rays", packet_rays.kernels, "single rays"]
    print("| " + " | ".join([*heads, f"ratio of times, {PAIRS} pairs", "other faces"]) + " |")
    print("|---" * 5 + "|")
    kinds = {f"{per_pulse} per pulse": survey_rays(flight, count, per_pulse) for per_pulse in (1, 7, 19)}
    order = stream(0, "order of rays").permutation(count)
    kinds["shuffled"] = tuple(array[order] for array in kinds["7 per pulse"])
    for name, (origins, directions) in kinds.items():
        times, faces = [], []
        for _ in range(PAIRS):
            for caster in (packet_rays, single_rays):
                start = time.thread_time()
                faces.append(caster.cast(origins, directions, RANGE))
                times.append(time.thread_time() - start)
        packet_times, single_times = np.array(times[::2]), np.array(times[1::2])
        ratio, agreement_figures = packet_times / single_times, agreement(mesh, origins, directions, *faces[:2])
        rates = [f"{len(origins) / np.median(seconds) / 1e6:.2f}" for seconds in (packet_times, single_times)]
        spread = f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})"
        others = f"{round(count * (1 - agreement_figures.same))}, {1e3 * agreement_figures.gap:.3f} mm"
        print(f"| {name} | {' | '.join(rates)} | {spread} | {others} |")


def main() -> None:
    """Measure all casters on the scenes of the command line and print Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", choices=tuple(SCENES), action="append", help="default: all")
    parser.add_argument("--rays", type=int, default=1_000_000, metavar="N", help="rays to cast (1000000)")
    parser.add_argument("--packets", action="store_true", help="only compare packets with single rays")
    for name in ("--prepare", "--measure", "--files", "--compare"):
        parser.add_argument(name, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.compare:
        compare_packets(options.compare, options.rays)
        sys.stdout.flush()
        os._exit(0)
    if options.prepare or options.measure:
        files = Path(options.files)
        result = _prepare(options.prepare, files, options.rays) if options.prepare else measure(options.measure, files)
        print(json.dumps(result), flush=True)
        os._exit(0)  # Blender's own way out can crash
    for scene in options.scene or SCENES:
        if options.packets:
            subprocess.run([sys.executable, __file__, "--compare", scene, "--rays", str(options.rays)], check=True)
            continue
        print(f"\n{scene}:\n", flush=True)
        print("\n".join(table(list(_rows(scene, options.rays)))), flush=True)


if __name__ == "__main__":
    main()
