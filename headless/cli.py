"""The console command `synthroads` with all of its sub-commands."""

import argparse
import sys
from collections.abc import Collection, Sequence
from typing import Any

from headless.commands import add_arguments, leave, module_of, run
from headless.error_lines import missing_package
from headless.parser import Parser, add_shared_options
from synthroads_addon.base.version import generator

COMMANDS = {
    "generate": "make a road, scan it and write cloud, parameters and pictures",
    "epochs": "survey a road several times, with changes in between and their truth at each point",
    "changes": "list changes between two parameter sets, detect them in clouds, and judge a detector",
    "parameters": "sample road parameters and write them to standard output",
    "check": "list the rules of the guidelines that a road breaks",
    "twin": "write a road's geometric-semantic model: CityJSON, IFC, OpenDRIVE, GeoJSON, OpenCRG",
    "dataset": "make a data set of many scenes from a recipe",
    "cloud": "describe, thin out, map, convert and draw point cloud files",
    "scan": "scan an existing scene: .blend, .glb, .obj and others",
    "compare": "measure how well synthetic clouds agree with real ones",
    "calibrate": "compare intensities of materials with a real cloud's, and fit the materials",
    "gallery": "render pictures of scenes, objects and materials",
    "tradeoff": "measure error against time for each setting that trades one for the other",
    "benchmark": "measure the speed of each stage, and compare it with its lower bound and its limit",
    "train": "train a segmentation or centreline model",
    "evaluate": "measure a trained model",
    "predict": "label a cloud, or find its road, with a trained model",
    "export": "write a trained network as ONNX",
    "experiment": "train variants that differ in their data, with several seeds, and compare their scores",
    "pack": "pack a data set's labelled points into one small file, to train on another machine",
    "forecast": "forecast how long the training of a segmentation takes on this machine",
    "centerline": "find the centreline of the road in a cloud, and where it can be trusted",
    "reconstruct": "turn a cloud into the parameters of its road",
    "road": "turn a road of an OpenDRIVE, LandXML or IFC file into a parameter set",
    "list": "list shipped names (scenarios, devices, ...) and the fields that --set takes",
}


class _PrintCompletion(argparse.Action):
    """Command-line action that prints a shell's completion script and ends the process."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        try:
            from headless.completion import completion_script

            print(completion_script(build_parser(), values))
        except ModuleNotFoundError as error:
            parser.exit(2, f"{missing_package(error)}\n")
        parser.exit()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the sub-command named in `argv` (the process's own arguments if None); return its exit code."""
    words = sys.argv[1:] if argv is None else argv
    arguments = build_parser([word for word in words if word in COMMANDS][:1]).parse_args(words)
    return run(module_of(arguments.command).run, arguments)


def build_parser(commands: Collection[str] = COMMANDS) -> argparse.ArgumentParser:
    """Return the argument parser of `synthroads`; only the given sub-commands, all by default, have their arguments.

    The others are listed with their summaries, so that a command loads nothing but its own modules.
    """
    parser = Parser(prog="synthroads", description="Synthetic motorways, scanned and labelled.")
    parser.add_argument("--version", action="version", version=generator())
    text = "print a script with which a shell completes commands, options, names and files"
    parser.add_argument("--print-completion", action=_PrintCompletion, choices=("bash", "fish", "zsh"), help=text)
    parsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, summary in COMMANDS.items():
        its_parser = parsers.add_parser(name, help=summary)
        if name in commands:
            module = module_of(name)
            its_parser.description = module.__doc__
            add_arguments(module, its_parser)
    add_shared_options(parser)
    return parser


def console() -> None:
    """Entry point of the console command `synthroads`; ends the process with the exit code."""
    leave(main)
