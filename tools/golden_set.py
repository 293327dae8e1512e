"""Compare what two versions of the source make: fourteen small jobs, every file of them, to the byte.

    python tools/golden_set.py --base COMMIT                     # with the Python, and so the Blender, that runs it
    python tools/golden_set.py --base COMMIT --jobs twins -v --keep DIR

The base is checked out beside the working tree; each job runs in both with the same words in folders of the same names.
A .blend file is compared by a dump of what is in it, JSON without the fields that say how long something took.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DRAFT = ("fidelity=draft", "road.length=120", "road.half_width=40", "vegetation_detail=0.3")
UAV = (*DRAFT, "scan.platform.lateral_offsets=[5]", "scan.lines_per_second=50", "scan.platform.speed=24")
PLAIN = ("colour.source=material",)
NO_SCENE = 'outputs=["parameters", "cloud", "centerline", "previews"]'
TWIN_FORMATS = ("cityjson", "ifc", "opendrive", "geojson")
TIMES = re.compile(r"seconds|_mb$|^(time|stages|memory|machine|duration|points_per_second|versions?|python|generator)$")
"""Names of fields that differ from run to run."""

RECIPE = """title: Tiny
seed: 5
scenario: rq31-600m-even
set:
  fidelity: draft
  vegetation_detail: 0
  outputs: [parameters, cloud, centerline]
  road.length: 300
  road.half_width: 20
  scan.lines_per_second: 50
  scan.platform.speed: 20
  scan.platform.lateral_offsets: [0]
  colour.source: material
  cloud.classes: "5"
layouts: [pointcept, semantickitti]
smallest_tile: 10
groups:
- {name: a, scenes: 2, split: {train: 1, validation: 1}}
"""
TRAINING = """task: centerline
threads: 1
data: {data_sets: [../data-set/set], cache: cache}
slices: {half_width: 20.0, points_per_slice: 96}
model: {name: single, cells: 4, point_width: 8, width: 16, context: 16, layers: 1, heads: 2, dropout: 0.1}
batches: {size: 4, steps: 4, passes: 2, validation: 4}
schedule: {epochs: 2, learning_rate: 0.003, warmup: 0.2}
"""
FLOOR_AND_BOX = """o Road
v -60 -30 0
v 60 -30 0
v 60 30 0
v -60 30 0
f 1 2 3 4
o Box Metal
v 10 2 0
v 12 2 0
v 12 4 0
v 10 4 0
v 10 2 3
v 12 2 3
v 12 4 3
v 10 4 3
f 5 6 10 9
f 6 7 11 10
f 7 8 12 11
f 8 5 9 12
f 9 10 11 12
"""
TRAJECTORY = "time,x,y,z,roll,pitch,heading\n" + "".join(
    f"{t / 2},{-30 + 6 * t / 2},{0.1 * t},{20 + 0.05 * t},{0.3 * (t % 3)},{0.2 * (t % 2)},90\n" for t in range(21)
)


@dataclass(frozen=True)
class GoldenJob:
    """Commands that run one after the other in a folder of their own, beside those of the jobs before.

    Attributes:
        commands: sub-commands of `synthroads` with their words.
        files: text by name, written before.
        lacking: what the commands say where this Python or Blender can't do the job; else they must succeed.
    """

    commands: tuple[tuple[str, ...], ...]
    files: tuple[tuple[str, str], ...] = ()
    lacking: str = ""


def generate(scenario: str, *changes: str) -> tuple[str, ...]:
    """Return the words of `synthroads generate` for a scenario with changes, into the folder ``out``."""
    return ("generate", "--scenario", scenario, "--output", "out", *settings(*changes))


def settings(*changes: str) -> tuple[str, ...]:
    """Return changes as words ``--set CHANGE`` of the command line."""
    return tuple(word for change in changes for word in ("--set", change))


CLOUD = "../constant-materials/out/cloud.laz"
JOBS = {
    "constant-materials": GoldenJob((generate("rq31-600m-even", *UAV, *PLAIN),)),
    "images": GoldenJob(
        (
            generate(
                "rq31-600m-even", *UAV, "colour.source=images", "colour.ground_sampling_distance=0.3", "road.length=60"
            ),
        )
    ),
    "pixel-per-return": GoldenJob(
        (generate("rq31-600m-even", *UAV, "colour.source=returns", "road.length=60"),), lacking="needs Blender 5.0"
    ),
    "airborne": GoldenJob((generate("airborne-1000m-even", *DRAFT, *PLAIN, "scan.pulse_rate_khz=150"),)),
    "vehicle": GoldenJob((generate("mobile-mapping-300m-even", *DRAFT, *PLAIN, "scan.pulse_rate_khz=150"),)),
    "tripod": GoldenJob((generate("tripod-200m-even", *DRAFT, *PLAIN, "scan.platform.turn_seconds=10"),)),
    "foreign-scene": GoldenJob(
        (
            ("scan", "scene.obj", "--up", "z", "--output", "path", "--path", "path.csv", "--height", "30"),
            ("scan", "scene.obj", "--up", "z", "--output", "trajectory", "--trajectory", "trajectory.csv"),
        ),
        (("scene.obj", FLOOR_AND_BOX), ("trajectory.csv", TRAJECTORY), ("path.csv", "x,y\n-40,0\n0,3\n40,0\n")),
    ),
    "sections": GoldenJob(
        (generate("rq31-600m-even", *UAV, *PLAIN, "road.length=400", "scan.section_length=100", NO_SCENE),)
    ),
    "data-set": GoldenJob((("dataset", "recipe.yaml", "--output", "set"),), (("recipe.yaml", RECIPE),)),
    "twins": GoldenJob(
        (
            generate("every-class-1500m", 'outputs=["parameters"]'),
            ("twin", "out/parameters.json", "--output", "twins", "--twin", ",".join(TWIN_FORMATS)),
            ("check", "out/parameters.json", "--json"),
        )
    ),
    "calibration": GoldenJob(
        (
            (
                *("calibrate", "--real", CLOUD, "--material", "asphalt=road", "--material", "paint_white=road_marking"),
                *("--save", "table.json", "--plot", "plot.png", "--json"),
            ),
        )
    ),
    "reconstruction": GoldenJob(
        (
            ("reconstruct", "../data-set/set/scenes/a-01/cloud.laz", "--output", "out"),
            ("reconstruct", CLOUD, "--output", "short"),
        )
    ),
    "training": GoldenJob(
        (
            ("train", "training.yaml", "--output", "run"),
            ("evaluate", "run", "../data-set/set", "--split", "validation", "--output", "scores"),
            ("predict", "run", "../data-set/set/scenes/a-01/cloud.laz", "--output", "lines.geojson"),
        ),
        (("training.yaml", TRAINING),),
        "package torch is missing",
    ),
    "cloud-files": GoldenJob(
        (
            ("parameters", "--seed", "7", "--count", "3"),
            ("cloud", "info", CLOUD, "--json"),
            *(("cloud", "convert", CLOUD, "-o", f"cloud.{ending}") for ending in ("las", "ply", "e57", "npz")),
            ("cloud", "subsample", CLOUD, "-o", "thin.laz", "--grid", "0.5"),
            ("list", "scenarios"),
            ("list", "fields"),
        )
    ),
}
RUN = "from headless.cli import console; console()"
DUMP = """
import sys, bpy
from pathlib import Path
from golden_dump import lines
bpy.ops.wm.open_mainfile(filepath=sys.argv[1], use_scripts=False)
digests = ("synthroads_key", "synthroads_look") # of the sources
kept = (line for line in lines() if not any(name in line for name in digests))
Path(sys.argv[2]).write_text("".join(kept), encoding="utf-8")
"""


def run_job(tree: Path, side: Path, name: str) -> None:
    """Run a job's commands with the source in `tree`; what they print and their exit codes become files too."""
    folder = side / name
    folder.mkdir(parents=True)
    for file, text in JOBS[name].files:
        (folder / file).write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PWD"] = str(folder)  # where Blender looks for relative names
    for number, words in enumerate(JOBS[name].commands):
        line = [sys.executable, "-P", "-c", RUN, *words, "--quiet"]
        process = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        error_text = process.stderr if process.returncode else ""
        output_text = f"exit code {process.returncode}\n{error_text}{process.stdout}".replace(
            str(tree), "TREE"
        ).replace(str(side), "")
        (folder / f"printed-{number}.txt").write_text(output_text, encoding="utf-8")


def content(path: Path) -> bytes:
    """Return the bytes that are compared of a file: without times, archives unpacked, .blend files dumped."""
    if path.suffix == ".blend":
        return blend_dump(path)
    if path.suffix in (".npz", ".pt"):  # archives, whose entries carry the time of day
        with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
            return b"".join(name.encode() + archive.read(name) for name in sorted(archive.namelist()))
    if path.suffix in (".json", ".txt") or path.name.endswith(".geojson"):
        return plain_text(path.read_text(encoding="utf-8")).encode()
    return path.read_bytes()


def plain_text(text: str) -> str:
    """Return a JSON text, perhaps after an exit code, without fields that differ from run to run; others as is."""
    head, separator, rest = text.partition("\n") if text.startswith("exit code") else ("", "", text)
    try:
        return head + separator + json.dumps(without_times(json.loads(rest)), indent=0)
    except ValueError:
        return text


def without_times(value: Any) -> Any:
    """Return a copy of JSON data without the fields (`TIMES`) of durations, memory, machine and versions."""
    if isinstance(value, dict):
        return {key: without_times(entry) for key, entry in value.items() if not TIMES.search(key)}
    return [without_times(entry) for entry in value] if isinstance(value, list) else value


def blend_dump(path: Path) -> bytes:
    """Return a text dump of everything in a .blend file, made in a separate Blender; the file itself if that fails."""
    with tempfile.TemporaryDirectory() as folder:
        source = (ROOT / SCENE_DUMP).read_text(encoding="utf-8")
        (Path(folder) / "golden_dump.py").write_text(source, encoding="utf-8")
        text = Path(folder) / "dump.txt"
        call = [sys.executable, "-c", DUMP, str(path), str(text)]
        subprocess.run(call, cwd=folder, capture_output=True, check=False)
        return text.read_bytes() if text.exists() else b"the file can't be opened: " + path.read_bytes()


SCENE_DUMP = Path("tests", "helpers", "scenes", "scene_hash.py")


def differences(base: Path, head: Path) -> list[str]:
    """Return a line for each file below two folders that one side lacks or whose compared content differs."""
    names = sorted({str(path.relative_to(side)) for side in (base, head) for path in side.rglob("*") if path.is_file()})
    lines = []
    for name in names:
        if not (base / name).exists() or not (head / name).exists():
            lines.append(f"{name}: only in {'HEAD' if (head / name).exists() else 'the base'}")
        elif content(base / name) != content(head / name):
            lines.append(f"{name}: differs")
    return lines


def main() -> int:
    """Compare the working tree with the command line's base commit; return 0 if nothing differs, else 1."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--base", required=True, metavar="COMMIT", help="what the working tree is compared with")
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=list(JOBS), metavar="NAME", help="these alone")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the files there")
    parser.add_argument("-v", "--verbose", action="store_true", help="print what each command came to")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch_folder:
        tree = Path(scratch_folder, "tree")
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", tree, arguments.base], cwd=ROOT, check=True)
        try:
            return compare(tree, (arguments.keep or Path(scratch_folder, "files")).resolve(), arguments)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)


def compare(tree: Path, files: Path, arguments: argparse.Namespace) -> int:
    """Run the jobs in the base's tree and in this one, print what differs; return 0 if nothing does, else 1."""
    has_failed = False
    with ThreadPoolExecutor(2) as pool:
        for name in arguments.jobs:
            list(pool.map(run_job, (tree, ROOT), (files / "base", files / "head"), (name, name)))
            base, head = files / "base" / name, files / "head" / name
            faults = differences(base, head)
            outputs = [text.read_text(encoding="utf-8") for text in sorted(head.glob("printed-*.txt"))]
            codes = [text.partition("\n")[0] for text in outputs]
            lacking_text = JOBS[name].lacking
            can_not_run = bool(lacking_text) and lacking_text in outputs[0]
            if not can_not_run:
                faults += [f"command {number}: {code}" for number, code in enumerate(codes) if code != "exit code 0"]
            has_failed |= bool(faults)
            count = sum(path.is_file() for path in head.rglob("*"))
            verdict = f"{len(faults)} FAULTS" if faults else f"not here: {lacking_text}" if can_not_run else "equal"
            print(f"{name}: {count} files, {verdict}", flush=True)
            for line in faults:
                print(f"  {line}")
            if arguments.verbose:
                print("  " + ", ".join(codes))
    return int(has_failed)


if __name__ == "__main__":
    sys.exit(main())
