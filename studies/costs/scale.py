"""Measure what a job costs by the road's length, points per metre and cores, and draw docs/pictures/scale.png.

    python studies/costs/scale.py --output out/scale [--lengths 300 3000 30000] [--speeds 40 20 10 5] [--cores 1 2]

Each job is a process of its own, whose processor time and peak memory the system tells. What every process takes to
begin, measured by a job of hardly any road, is taken off. Prints the tables of docs/benchmark.md. With
``--drawn`` nothing is measured again: the tables and the picture are those of the results that are there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.base.machine import available_cores, cores_of_children, machine  # noqa: E402
from synthroads_addon.base.text.table import markdown_table  # noqa: E402

TARGET = ROOT / "docs" / "pictures" / "scale.png"
THIN = {
    "fidelity": "draft",
    "outputs": ["cloud"],
    "scan.section_length": 500,
    "scan.pulse_rate_khz": 100,
    "scan.platform.lateral_offsets": [0],
    "scan.platform.speed": 40,
}
"""Settings of all jobs: few points, by sections of 500 m where the road is longer than two."""
TINY, SHORT = 20, 300
"""Road of the job that shows what each takes to begin, and of those whose points and cores vary, m."""


def job(cores: int, settings: dict[str, Any]) -> dict[str, Any]:
    """Generate a scene in a process of its own on so many cores; return seconds, processor seconds, MB, points."""
    changes = [part for name, value in settings.items() for part in ("--set", f"{name}={json.dumps(value)}")]
    with tempfile.TemporaryDirectory(prefix="synthroads-") as folder, cores_of_children(cores):
        command = [sys.executable, "-m", "headless.generate", "--output", f"{folder}/out", *changes, "--json"]
        begin = time.perf_counter()
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        assert process.stdout is not None
        report = json.loads(process.stdout.read())
        _, status, usage = os.wait4(process.pid, 0)
        if status:
            raise SystemExit(f"failed: {' '.join(command)}")
        seconds = time.perf_counter() - begin
    return {
        "cores": cores,
        "seconds": seconds,
        "processor": usage.ru_utime + usage.ru_stime,
        "memory_mb": usage.ru_maxrss / 1024.0,
        "points": report.get("counts", {}).get("points", 0),
    }


def measure(lengths: Sequence[int], speeds: Sequence[int], cores: Sequence[int]) -> dict[str, Any]:
    """Return results by what varies: ``begin``, and lists of ``length``, ``points`` and ``cores``."""
    most_cores = cores[-1]
    results: dict[str, Any] = {
        "machine": machine({}),
        "begin": {"length": TINY, **job(most_cores, {**THIN, "road.length": TINY})},
    }
    jobs_of_name = {
        "length": [(length, most_cores, {"road.length": length}) for length in lengths],
        "points": [(SHORT, most_cores, {"road.length": SHORT, "scan.platform.speed": speed}) for speed in speeds],
        "cores": [(SHORT, number, {"road.length": SHORT}) for number in cores],
    }
    for name, jobs in jobs_of_name.items():
        results[name] = []
        for length, number, changes in jobs:
            results[name].append({"length": length, **job(number, {**THIN, **changes})})
            print(name, results[name][-1], file=sys.stderr, flush=True)
    return results


def per_metre(results: dict[str, Any], row: dict[str, Any], name: str = "processor") -> float:
    """Return milliseconds per metre of road, less what a process takes to begin."""
    begin = results["begin"]
    return 1e3 * float(row[name] - begin[name]) / float(row["length"] - begin["length"])


def tables(results: dict[str, Any]) -> str:
    """Return the results as Markdown."""
    texts = []
    for name, title in (("length", "road, km"), ("points", "points/m"), ("cores", "cores")):
        rows = []
        for row in results[name]:
            first_cells = {"length": f"{row['length'] / 1e3:g}", "points": f"{row['points'] / row['length']:,.0f}"}
            begin = first_cells.get(name, str(row["cores"]))
            costs = [f"{per_metre(results, row, unit):.2f}" for unit in ("processor", "seconds")]
            rows.append([begin, f"{row['points']:,}", *costs, f"{row['memory_mb']:,.0f}"])
        heads = [title, "points", "processor time, ms/m", "time, ms/m", "memory, MB"]
        texts.append("\n".join(markdown_table(heads, rows)))
    return f"Machine: {results['machine']}\n\n" + "\n\n".join(texts) + "\n"


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw processor time per metre and memory against length, and processor time against points per metre."""
    figure = new_figure(12.0, 3.6)
    time_axis, memory_axis, points_axis = figure.subplots(1, 3)
    rows = results["length"]
    kilometres = [row["length"] / 1e3 for row in rows]
    time_axis.plot(kilometres, [per_metre(results, row) for row in rows], "o-", color="#00798c")
    time_axis.set(xscale="log", xlabel="road (km)", ylabel="processor time (ms per metre)", ylim=(0.0, None))
    memory_axis.plot(kilometres, [row["memory_mb"] for row in rows], "o-", color="#d1495b")
    memory_axis.set(xscale="log", xlabel="road (km)", ylabel="peak memory (MB)", ylim=(0.0, None))
    rows = results["points"]
    density = [row["points"] / row["length"] for row in rows]
    points_axis.plot(density, [per_metre(results, row) for row in rows], "o-", color="#00798c")
    label = "processor time (ms per metre)"
    points_axis.set(xlabel="points per metre", ylabel=label, xlim=(0.0, None), ylim=(0.0, None))
    for axis in (time_axis, memory_axis, points_axis):
        axis.grid(alpha=0.3)
    for axis in (time_axis, memory_axis):
        axis.xaxis.set_major_formatter("{x:g}")
    save_figure(figure, path, dpi=90)


def main() -> None:
    """Measure or read the results, print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--lengths", nargs="+", type=int, default=[300, 3000, 30_000], metavar="M")
    parser.add_argument("--speeds", nargs="+", type=int, default=[40, 20, 10, 5], metavar="M/S", help="of the scanner")
    parser.add_argument("--cores", nargs="+", type=int, default=sorted({1, min(2, available_cores())}), metavar="N")
    parser.add_argument("--drawn", action="store_true", help="only draw what was measured before")
    arguments = parser.parse_args()
    result_file = arguments.output / "scale.json"
    if not arguments.drawn:
        arguments.output.mkdir(parents=True, exist_ok=True)
        result_file.write_text(
            json.dumps(measure(arguments.lengths, arguments.speeds, arguments.cores), indent=1) + "\n"
        )
    results = json.loads(result_file.read_text())
    print(tables(results))
    draw(results, TARGET)


if __name__ == "__main__":
    main()
