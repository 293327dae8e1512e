"""Trained networks as ONNX files, for programs without PyTorch: written, and compared with what PyTorch says."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_file_target, write_file

OPSET = 18
"""Version of ONNX' operators."""
TOLERANCE = 1e-4
"""Largest difference of the outputs of ONNX Runtime and of PyTorch, in the outputs' units."""


@dataclass(frozen=True)
class Exportable:
    """A network with the inputs, names and metadata by which it is written as ONNX.

    Attributes:
        model: network whose `forward(*tensors)` takes the inputs in order, and returns a tuple of the outputs.
        inputs: example of each input by name, on the CPU.
        dynamic: by input's name the axes of any length, with the length's name.
        outputs: names of the outputs.
        metadata: texts for the file, by name.
    """

    model: nn.Module
    inputs: Mapping[str, Tensor]
    dynamic: Mapping[str, Mapping[int, str]]
    outputs: tuple[str, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)


def write_onnx(network: Exportable, target: Path, *, overwrite: bool = False) -> dict[str, Any]:
    """Write a network as an ONNX file in single precision; return its inputs, outputs, bytes and largest difference.

    ``difference`` is the largest difference between ONNX Runtime's and PyTorch's outputs on the example; None where
    ONNX Runtime isn't installed.

    Raises:
        InputError: the package onnx or onnxscript isn't installed, or the difference is more than `TOLERANCE`.
        OutputError: the file is there already or can't be written.
    """
    check_file_target(target, overwrite=overwrite)
    content = onnx_bytes(network)
    difference = largest_difference(network, content)
    if difference is not None and not difference <= TOLERANCE:
        raise InputError("export", difference, f"ONNX Runtime's outputs must be within {TOLERANCE:g} of PyTorch's")
    write_file(target, content, overwrite=overwrite)
    return {
        "inputs": {name: _shape(name, value, network) for name, value in network.inputs.items()},
        "outputs": list(network.outputs),
        "bytes": len(content),
        "difference": difference,
    }


def onnx_bytes(network: Exportable) -> bytes:
    """Return a network as the bytes of an ONNX file.

    Raises:
        InputError: the package onnx or onnxscript isn't installed.
    """
    axes = {name: torch.export.Dim(name) for lengths in network.dynamic.values() for name in lengths.values()}
    shapes = tuple(
        {axis: axes[length] for axis, length in network.dynamic.get(name, {}).items()} for name in network.inputs
    )
    for name in ("onnxscript", "torch.onnx"):  # they warn of packages that these networks don't need
        logging.getLogger(name).setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings(), torch.no_grad():
            warnings.simplefilter("ignore")  # of PyTorch's own deprecations
            program = torch.onnx.export(
                network.model.eval(),
                tuple(network.inputs.values()),
                dynamo=True,
                opset_version=OPSET,
                input_names=list(network.inputs),
                output_names=list(network.outputs),
                dynamic_shapes=(shapes,),
                external_data=False,
                verbose=False,
            )
    except ModuleNotFoundError as error:
        text = f"needs the package {error.name}: pip install '.[onnx]' in the repository"
        raise InputError("export", None, text) from None
    assert program is not None
    proto = program.model_proto
    del proto.metadata_props[:]
    for name, value in sorted(network.metadata.items()):
        entry = proto.metadata_props.add()
        entry.key, entry.value = name, value
    return bytes(proto.SerializeToString())


def largest_difference(network: Exportable, content: bytes) -> float | None:
    """Return the largest difference of ONNX Runtime's outputs from PyTorch's on the example; None if it is missing."""
    try:
        import onnxruntime  # optional: 30 MB that only comparisons need
    except ModuleNotFoundError:
        return None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    outputs = session.run(list(network.outputs), {name: value.numpy() for name, value in network.inputs.items()})
    with torch.no_grad():
        references = network.model(*network.inputs.values())
    return max(
        float(np.abs(output - reference.numpy()).max()) for output, reference in zip(outputs, references, strict=True)
    )


def metadata_texts(**entries: Any) -> dict[str, str]:
    """Return metadata entries as texts: text as it is, other values as JSON."""
    return {
        name: value if isinstance(value, str) else json.dumps(value, sort_keys=True) for name, value in entries.items()
    }


def _shape(name: str, value: Tensor, network: Exportable) -> list[int | str]:
    """Return an input's shape, with the names of its dynamic axes in the place of their lengths."""
    dynamic = network.dynamic.get(name, {})
    return [dynamic.get(axis, size) for axis, size in enumerate(value.shape)]
