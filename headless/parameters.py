"""Sample road parameters and write them to standard output: one set, or many as JSON lines."""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.options import add_changes_argument, all_changes
from synthroads_addon.base.changes import apply_change
from synthroads_addon.road.guidelines import DESIGN_CLASSES, STANDARD_CROSS_SECTIONS, USUAL_SECTION
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario

_FIELDS = {
    "design_class": "road.design_class",
    "cross_section": "road.cross_section",
    "length": "road.length",
    "seed": "seed",
}
"""Arguments that are short for fields of the scenario."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads parameters` to its parser."""
    parser.add_argument("--seed", type=int, metavar="N", help=f"seed of the first set ({Scenario().seed})")
    parser.add_argument("--count", type=int, metavar="K", help="write K sets of consecutive seeds, one per line")
    usual_class, sections = next(iter(USUAL_SECTION)), ", ".join(STANDARD_CROSS_SECTIONS)
    text = f"design class of the RAA or RAL ({usual_class}, or the first that has the cross-section)"
    parser.add_argument("--design-class", choices=DESIGN_CLASSES, help=text)
    text = ", ".join(f"{section} for {name}" for name, section in USUAL_SECTION.items())
    parser.add_argument("--cross-section", metavar="RQ", help=f"one of {sections} (that of the design class: {text})")
    text = f"length of the road, m ({RoadScenario().length:g})"
    parser.add_argument("--length", type=float, metavar="M", help=text)
    add_changes_argument(parser)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads parameters`; return exit code, parameters as JSON data, and text or an iterator of lines."""
    data: Any = {}
    for change in all_changes(arguments, _FIELDS):
        data = apply_change(data, change, Scenario)
    scenario = Scenario.from_dict(data)
    parameters = sample_road(scenario.road, scenario.seed)
    if arguments.count is None:
        return 0, parameters.to_dict(), parameters.to_json().rstrip("\n")
    seeds = range(scenario.seed, scenario.seed + arguments.count)
    return 0, {"count": arguments.count}, (_line(sample_road(scenario.road, seed)) for seed in seeds)


def _line(parameters: RoadParameters) -> str:
    """Return parameters as a line of JSON."""
    return parameters.model_dump_json(exclude_none=True, by_alias=True)  # twice as fast as by way of a dictionary


if __name__ == "__main__":
    entry("parameters")
