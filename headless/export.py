"""Write a trained network as an ONNX file, for programs without PyTorch, and compare it with PyTorch's own outputs."""

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from synthroads_addon.base.files import check_file_target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads export` to its parser."""
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a trained run, or name of a shipped model")
    text = "ONNX file to write (RUN.onnx in the current folder)"
    parser.add_argument("--output", type=Path, metavar="FILE", help=text)
    parser.set_defaults(writes=True)
    parser.add_argument("--overwrite", action="store_true", help="replace a file that is already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads export`; return exit code, inputs and outputs as JSON data and printed text."""
    target = arguments.output or Path(f"{arguments.run.name}.onnx")
    check_file_target(target, overwrite=arguments.overwrite, ending=".onnx")
    from ml.onnx_export import write_onnx
    from ml.shipped import open_run
    from ml.tasks import task

    trained = open_run(arguments.run)
    network = task(trained.configuration.task).exportable(trained)
    figures = write_onnx(network, target, overwrite=arguments.overwrite)
    return 0, figures, summary(figures, target)


def summary(figures: dict[str, Any], target: Path) -> str:
    """Return what was written as text: inputs with their shapes, outputs, size, difference from PyTorch."""
    lines = [f"  {name}: {' x '.join(map(str, shape))}" for name, shape in figures["inputs"].items()]
    comparison = "not compared: onnxruntime isn't installed"
    if figures["difference"] is not None:
        comparison = f"within {figures['difference']:.1e} of PyTorch"
    size = f"{figures['bytes'] / 1e6:.2f} MB"
    return "\n".join([f"written {target}: {size}, {comparison}", *lines, f"outputs: {', '.join(figures['outputs'])}"])


if __name__ == "__main__":
    entry("export")
