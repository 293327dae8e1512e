"""Measure how long IFC files take to write, and how large they are: 600 m and 10 km of motorway.

Usage: python tools/benchmark_twin_ifc.py
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.ifc.writer import write_ifc


def main() -> None:
    """Print a line per length."""
    for length in (600.0, 10_000.0):
        parameters = sample_road(RoadScenario.from_dict({"cross_section": "RQ36", "length": length}), 3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "twin.ifc"
            start, own = time.perf_counter(), time.process_time()
            write_ifc(parameters, path)
            wall, processor = time.perf_counter() - start, time.process_time() - own
            size, lines = path.stat().st_size / 1e6, path.read_text().count("\n")
        print(
            f"{length:g} m: {len(parameters.objects)} objects, {wall:.1f} s ({processor:.1f} s of one core), "
            f"{size:.1f} MB, {lines} entities"
        )


if __name__ == "__main__":
    main()
