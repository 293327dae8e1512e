"""Weights come back from their file bit by bit, as the format says they lie; a damaged file is one line."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
import torch

from ml.safetensors import read_metadata, read_tensors, write_tensors
from synthroads_addon.base.errors import InputError, MissingFileError


def test_weights_come_back_bit_by_bit(tmp_path: Path) -> None:
    torch.manual_seed(1)
    tensors = {
        "b": torch.randn(3, 4).half(),
        "a": torch.randn(2),
        "count": torch.tensor(7),
        "empty": torch.zeros(0, 3),
        "turned": torch.arange(6.0).reshape(2, 3).T,
        "wide": torch.randn(2, dtype=torch.float64),
        "brain": torch.randn(3).bfloat16(),
        "mask": torch.tensor([True, False, True]),
    }
    write_tensors(tmp_path / "w.safetensors", tensors, {"format": "pt", "title": "Straße"})
    found = read_tensors(tmp_path / "w.safetensors")
    assert list(found) == sorted(tensors)
    for name, tensor in tensors.items():
        assert found[name].dtype == tensor.dtype
        assert found[name].shape == tensor.shape
        assert torch.equal(found[name], tensor)
    assert read_metadata(tmp_path / "w.safetensors") == {"format": "pt", "title": "Straße"}


def test_the_file_is_laid_out_as_the_format_says(tmp_path: Path) -> None:
    write_tensors(tmp_path / "w.safetensors", {"x": torch.tensor([1.0, 2.0])}, {})
    content = (tmp_path / "w.safetensors").read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    assert header["x"] == {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}
    assert struct.unpack("<2f", content[8 + length :]) == (1.0, 2.0)
    assert length % 8 == 0


def test_a_damaged_file_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    write_tensors(path, {"x": torch.arange(10.0)}, {})
    whole = path.read_bytes()
    for content, said in (
        (whole[:-4], "must lie inside the file"),
        (whole[:20], "must be an undamaged file of weights"),
        (b"", "must be an undamaged file of weights"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said):
            read_tensors(path)
    path.write_bytes(whole.replace(b'"shape":[10]', b'"shape":[11]'))
    with pytest.raises(InputError, match="must lie inside"):
        read_tensors(path)
    with pytest.raises(MissingFileError):
        read_tensors(tmp_path / "none.safetensors")
