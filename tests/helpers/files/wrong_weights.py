"""Checkpoints and files of weights made wrong: tensors of other shapes and kinds, missing members, odd numbers."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from typing import Any

import torch
from hypothesis import strategies as st

from tests.helpers.files.mutations import HOSTILE, wrong_values

Change = Callable[[dict[str, Any], str], None]


def _changes() -> tuple[Change, ...]:
    """Return changes of one entry of a dictionary of tensors."""

    def put(value: Callable[[torch.Tensor], Any]) -> Change:
        return lambda tensors, name: tensors.update({name: value(tensors[name])})

    return (
        lambda tensors, name: tensors.pop(name),
        lambda tensors, name: tensors.update({f"{name}.x": tensors.pop(name)}),
        lambda tensors, name: tensors.update({f"x.{name}": tensors[name]}),
        *map(
            put,
            (torch.Tensor.flatten, lambda t: t[None], lambda t: t.flatten()[:0], lambda t: t.t() if t.ndim == 2 else t),
        ),
        *map(
            put, (torch.Tensor.double, torch.Tensor.half, torch.Tensor.long, torch.Tensor.bool, torch.Tensor.to_sparse)
        ),
        *map(
            put,
            (lambda t: t.to(torch.complex64), lambda t: t.to("meta"), lambda t: torch.cat([t.flatten(), t.flatten()])),
        ),
        *(put(lambda t, number=number: torch.full_like(t.double(), number)) for number in _NUMBERS),
        *(put(lambda t, value=value: value) for value in (None, 3, "x", [1.0], {}, float("nan"), True, b"bytes")),
    )


_NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e30, -1.0, 0.0, 1e300)


def wrong_checkpoints(state: Mapping[str, Any]) -> st.SearchStrategy[bytes]:
    """Return checkpoints whose weights, number of epochs or optimiser differ from a sound one's."""
    change = st.tuples(st.integers(0, 2**31), st.sampled_from(_changes()))
    weights = st.lists(change, min_size=1, max_size=2).map(lambda changes: _with_weights(state, changes))
    members = st.tuples(st.sampled_from(sorted(state)), st.sampled_from(HOSTILE))
    replaced = members.map(lambda told: {**state, told[0]: told[1]})
    without = st.sampled_from(sorted(state)).map(lambda name: {key: state[key] for key in state if key != name})
    others = st.sampled_from(HOSTILE)
    return st.one_of(weights, weights, weights, replaced, without, others).map(_saved)


def _with_weights(state: Mapping[str, Any], changes: list[tuple[int, Change]]) -> dict[str, Any]:
    tensors = dict(state["model"])
    for number, change in changes:
        if tensors:
            name = sorted(tensors)[number % len(tensors)]
            if isinstance(tensors[name], torch.Tensor):
                change(tensors, name)
    return {**state, "model": tensors}


def _saved(state: Any) -> bytes:
    content = io.BytesIO()
    torch.save(state, content)
    return content.getvalue()


def wrong_headers(content: bytes) -> st.SearchStrategy[bytes]:
    """Return safetensors files whose header has wrong values, or whose texts are JSON with wrong values."""
    length = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + length]), content[8 + length :]
    texts = header["__metadata__"]

    def with_text(told: tuple[str, Any]) -> Any:
        return {**header, "__metadata__": {**texts, told[0]: json.dumps(told[1])}}

    inner = [
        wrong_values([json.loads(texts[name])]).map(lambda value, name=name: with_text((name, value)))
        for name in ("configuration", "calibration")
        if name in texts
    ]
    return st.one_of(wrong_values([header]), *inner).map(lambda value: _file(value, data))


def wrong_numbers(content: bytes, numbers: tuple[float, ...] = _NUMBERS) -> st.SearchStrategy[bytes]:
    """Return safetensors files one of whose tensors of half or single precision holds a number throughout."""
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    kinds = {"F16": torch.float16, "F32": torch.float32}
    names = sorted(name for name, told in header.items() if told.get("dtype") in kinds)

    def changed(told: tuple[str, float]) -> bytes:
        first, last = header[told[0]]["data_offsets"]
        kind = kinds[header[told[0]]["dtype"]]
        number = torch.full(((last - first) // kind.itemsize,), told[1], dtype=torch.float64).to(kind)
        begin = 8 + length
        return content[: begin + first] + number.numpy().tobytes() + content[begin + last :]

    return st.tuples(st.sampled_from(names), st.sampled_from(numbers)).map(changed)


def _file(header: Any, data: bytes) -> bytes:
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data
