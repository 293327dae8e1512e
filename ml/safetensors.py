"""Weights in the safetensors format: a header that says where each tensor lies, and the tensors' bytes, nothing to run.

The format is that of https://huggingface.co/docs/safetensors: 8 bytes with the header's length, the header as JSON, the
data. Readers of others open these files, and theirs are read here.
"""

import json
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.files import write_file

METADATA = "__metadata__"
_LENGTH = 8
_LARGEST_HEADER = 100_000_000
_ALIGNMENT = 8
_TYPES: dict[str, torch.dtype] = {
    "F64": torch.float64,
    "F32": torch.float32,
    "F16": torch.float16,
    "BF16": torch.bfloat16,
    "I64": torch.int64,
    "I32": torch.int32,
    "I16": torch.int16,
    "I8": torch.int8,
    "U8": torch.uint8,
    "BOOL": torch.bool,
}
_NAMES = {dtype: name for name, dtype in _TYPES.items()}


def write_tensors(
    path: Path, tensors: Mapping[str, Tensor], metadata: Mapping[str, str], *, overwrite: bool = False
) -> None:
    """Write tensors by name, in the order of their names, and texts about them; the same bytes for the same content.

    Raises:
        OutputError: the file is there already or can't be written.
    """
    header: dict[str, Any] = {METADATA: dict(sorted(metadata.items()))}
    parts: list[bytes] = []
    begin = 0
    for name in sorted(tensors):
        tensor = tensors[name].detach().cpu().contiguous()
        content = tensor.reshape(-1).view(torch.uint8).numpy().tobytes() if tensor.numel() else b""
        offsets = [begin, begin + len(content)]
        header[name] = {"dtype": _NAMES[tensor.dtype], "shape": list(tensor.shape), "data_offsets": offsets}
        parts.append(content)
        begin += len(content)
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    write_file(path, b"".join([len(text).to_bytes(_LENGTH, "little"), text, *parts]), overwrite=overwrite)


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata texts of a safetensors file, without reading its tensors.

    Raises:
        MissingFileError, InputError: there is no such file, or it is damaged.
    """
    texts = _read_header(path)[0].get(METADATA, {})
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        raise InputError(f"{path}: {METADATA}", None, "must be an object of names and texts")
    return texts


def read_tensors(path: Path) -> dict[str, Tensor]:
    """Return the tensors of a safetensors file by name, as they are stored.

    Raises:
        MissingFileError, InputError: there is no such file, or it is damaged.
    """
    header, begin = _read_header(path)
    content = np.fromfile(path, dtype=np.uint8, offset=begin)
    return {name: _read_tensor(path, name, entry, content) for name, entry in header.items() if name != METADATA}


def _read_header(path: Path) -> tuple[dict[str, Any], int]:
    """Return a file's header as a dictionary, and the offset of its data in bytes."""
    if not path.is_file():
        raise MissingFileError(str(path), None, "there is no such file of weights")
    with path.open("rb") as file:
        length = int.from_bytes(file.read(_LENGTH), "little")
        text = file.read(length) if 0 < length <= _LARGEST_HEADER else b""
    try:
        header = json.loads(text)
    except ValueError:
        header = None
    if len(text) != length or not isinstance(header, dict):
        raise InputError(str(path), None, "must be an undamaged file of weights (safetensors)")
    return header, _LENGTH + length


def _read_tensor(path: Path, name: str, entry: Any, content: np.ndarray[Any, np.dtype[np.uint8]]) -> Tensor:
    """Return one tensor by its entry in the header (dtype, shape, data_offsets), from the file's data bytes."""
    damage_error = InputError(
        f"{path}: {name}", None, "its data must lie inside the file and be as long as the shape says"
    )
    try:
        dtype, shape, (begin, end) = _TYPES[entry["dtype"]], list(entry["shape"]), entry["data_offsets"]
    except (KeyError, TypeError, ValueError):
        raise damage_error from None
    if any(type(number) is not int for number in (*shape, begin, end)):
        raise InputError(f"{path}: {name}", None, "its shape and data_offsets must be whole numbers")
    size = prod(shape) * dtype.itemsize
    if not 0 <= begin <= end <= len(content) or end - begin != size or any(count < 0 for count in shape):
        raise damage_error
    part = np.array(content[begin:end])  # aligned and writable, as torch wants it
    return torch.from_numpy(part).view(dtype).reshape(shape) if size else torch.empty(shape, dtype=dtype)
