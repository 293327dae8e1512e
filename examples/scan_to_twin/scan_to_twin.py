"""Turn a scan into the parameters of its road, and these into CityJSON and OpenDRIVE; say how near it comes."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from synthroads_addon import Job, generate, load_scenario, read_parameters
from synthroads_addon.base.errors import SynthRoadsError
from synthroads_addon.reconstruction.comparison import compare
from synthroads_addon.reconstruction.report import ReconstructionJob, run_reconstruction
from synthroads_addon.twin.formats import write_twin

SMALL = ["seed=3", "fidelity=draft", "road.length=180", "road.half_width=20", "scan.platform.speed=20"]
FORMATS = ("cityjson", "opendrive")


def main(output: Path, cloud: Path | None = None) -> None:
    """Reconstruct a scan, of a small road that is made if none is given, and write its twin."""
    truth = None
    if cloud is None:
        generate(Job(load_scenario("rq31-600m", SMALL), output / "scan"))
        cloud, truth = output / "scan" / "cloud.laz", output / "scan" / "parameters.json"
    road = run_reconstruction(ReconstructionJob(cloud))
    parameters = road.reconstruction.parameters
    (output / "twin").mkdir(parents=True, exist_ok=True)
    (output / "parameters.json").write_text(parameters.to_json(), encoding="utf-8")
    write_twin(parameters, output / "twin", FORMATS)
    city = json.loads((output / "twin" / "twin.city.json").read_text(encoding="utf-8"))
    print(f"{parameters.alignment.length:.1f} m of road, {len(city['CityObjects'])} objects in CityJSON")
    print(f"doubtful: {road.report['judgement']['doubtful'] or 'nothing'}")
    if truth is not None:
        print(f"metres from the true centreline: {compare(parameters, read_parameters(truth))['centreline']}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    parser.add_argument("cloud", type=Path, nargs="?", help="LAZ, LAS, PLY or NPZ; if left out, a small one is made")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
