"""Sample road parameters and write them to standard output: one set, or many as JSON lines."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.cli import Outcome, add_changes_argument, add_common_arguments, entry
from synthroads_addon.core.parameters.limits import STANDARD_CROSS_SECTIONS
from synthroads_addon.core.parameters.model import DESIGN_CLASSES, RoadParameters
from synthroads_addon.core.parameters.sampler import sample_road
from synthroads_addon.core.scenario import Scenario, apply_change


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `synthroads parameters`."""
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the first set (1)")
    parser.add_argument("--count", type=int, metavar="K", help="write K sets of consecutive seeds, one per line")
    parser.add_argument("--design-class", choices=DESIGN_CLASSES, default="EKA1A", help="design class of the RAA")
    sections = ", ".join(STANDARD_CROSS_SECTIONS)
    parser.add_argument("--cross-section", default="RQ31", metavar="RQ", help=f"one of {sections}")
    parser.add_argument("--length", type=float, default=600.0, metavar="M", help="length of the road, m (600)")
    add_changes_argument(parser)
    add_common_arguments(parser)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads parameters`."""
    road = {
        "design_class": arguments.design_class,
        "cross_section": arguments.cross_section,
        "length": arguments.length,
    }
    data: dict[str, Any] = {"road": road, "seed": arguments.seed}
    for change in arguments.changes:
        data = apply_change(data, change)
    scenario = Scenario.from_dict(data)
    first = sample_road(scenario.road, scenario.seed)
    if arguments.count is None:
        return 0, first.to_dict(), first.to_json().rstrip("\n")
    seeds = range(scenario.seed, scenario.seed + arguments.count)
    return 0, {"count": arguments.count}, (_line(sample_road(scenario.road, seed)) for seed in seeds)


def _line(parameters: RoadParameters) -> str:
    return parameters.model_dump_json(exclude_none=True, by_alias=True)  # twice as fast as by way of a dictionary


if __name__ == "__main__":
    entry("parameters")
