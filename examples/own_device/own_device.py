"""Scan a road by a scanner of one's own, which is a JSON file, and measure that it does what the file says."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from synthroads_addon import Job, generate, load_scenario, open_cloud
from synthroads_addon.base.errors import SynthRoadsError

DEVICE = Path(__file__).with_name("robot.json")
SETTINGS = [
    *("fidelity=draft", "road.length=60", "road.half_width=20", f"scan.device={DEVICE}"),
    *("scan.platform.kind=vehicle", "scan.platform.height=1.2", "scan.platform.speed=4", "colour.source=material"),
    *("scan.lines_per_second=10", 'cloud.attributes=["range","incidence"]'),
]


def main(output: Path) -> None:
    """Scan into a folder and print the ranges of the points beside those of the file."""
    report = generate(Job(load_scenario("mobile-mapping-300m", SETTINGS), output))
    with open_cloud(output / "cloud.laz") as cloud:
        blocks = list(cloud.blocks())
    ranges = np.concatenate([block.range for block in blocks])
    returns = np.concatenate([block.number_of_returns for block in blocks])
    print(f"{report['counts']['points']:,} points of {report['counts']['pulses']:,} pulses")
    print(f"ranges {ranges.min():.2f} m to {ranges.max():.2f} m; by the file 0.5 m, and 40 m for a target of 20 %")
    print(f"returns of a pulse: {returns.max()} at most; the file allows 1")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
