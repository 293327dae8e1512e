"""Valid files made wrong, for tests that feed them to readers: wrong values in the right places, and damaged bytes."""

from __future__ import annotations

import json
import os
import resource
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from synthroads_addon.base.errors import SynthRoadsError

LONGEST = 10.0
"""Seconds of the processor that a reader may take for one file of a few kilobytes."""
FUZZ_SEED = os.environ.get("FUZZ_SEED") or None
FUZZ_CASES = int(os.environ.get("FUZZ_CASES") or 10_000)
"""Cases of commands that `make fuzz` runs."""
_ROOM = 4 << 30  # bytes of address space that a reader may take beyond what is taken already

Part = dict[str, Any] | list[Any]

HOSTILE: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 0.5, -0.0, 1e-300, 1e-9, 5e-324, 1e300, -1e300, 1e15, -1e15, 1e8, 1e5, 360.0),
    *(float("nan"), float("inf"), -float("inf"), 2**31, 2**53 + 1, 2**63, -(2**63), 2**64, 10**30, 10**400),
    *("", " ", "0", "nan", "1e5", "x" * 100_000, "\0", "a\nb", "\u202e\u0000", "../../etc/passwd", "/dev/null", "."),
    *("\U0001f6a7", "\ud800", "é" * 300, "%s%n", "{}", "null", "2024-01-01", "EPSG:25832", "nowhere.json", "."),
    *([], {}, [[]], [None], {"": None}, {"type": None}, [0] * 5000, [[0.0, 0.0]] * 300, {"type": "Alignment"}),
)
"""Values that are wrong almost everywhere."""

TOKENS: tuple[bytes, ...] = (
    *(b"\0", b"\xff", b"\xfe\xff", b"\xef\xbb\xbf", b"\xc3", b"\xed\xa0\x80", b"\r", b"\n", b"\r\n", b"\x1a", b"\x85"),
    *(b"NaN", b"Infinity", b"-Infinity", b"1e999", b"-0", b"00", b"9" * 5000, b"1e-999", b"0x10", b"1_000", b"nan"),
    *(
        b'"',
        b"'",
        b"\\",
        b"\\u0000",
        b"\\ud800",
        b",",
        b",,",
        b":",
        b"{",
        b"}",
        b"[",
        b"]",
        b"[" * 200_000,
        b"//",
        b"#",
    ),
    *(b'{"a":' * 20_000, b"null", b"true", b";", b"\t", b" ", b"x" * 200_000, b'"' + b"y" * 200_000, b"\xe2\x80\xa8"),
)
"""Text that is put into the middle of a text."""

YAML_TOKENS: tuple[bytes, ...] = (
    *(b"&a ", b"*a", b"<<: *a", b"!!python/object/apply:os.system ['true']\n", b"!!binary aGk=", b"!!set {a, b}"),
    *(b"---\n", b"...\n", b"? [a]\n: b\n", b"%YAML 9.9\n---\n", b"- ", b"|\n", b">-\n", b"!!float x", b"2024-01-01"),
    *(b"&a [*a]", b"{<<: 3}", b"[" * 3000, b"a: " * 50, b"=", b"1:30:00", b"0o17", b"~", b"\t- a", b"? ? ? ?", b"!<x>"),
)


@contextmanager
def limited(seconds: float = LONGEST) -> Iterator[None]:
    """Fail where what stands in the block hangs, and let it run out of memory before the machine does.

    The limit is on the processor's time: the machine may be busy with something else.
    """

    def stop(*_: object) -> None:
        pytest.fail(f"still busy after {seconds:g} s of the processor")

    before = signal.signal(signal.SIGPROF, stop)
    space = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 (once per case: cheaper)
        taken = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + _ROOM, space[1]))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    began = time.process_time()
    try:
        yield
        assert time.process_time() - began < seconds
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_AS, space)
        signal.signal(signal.SIGPROF, before)


def accepted(action: Callable[[], object]) -> bool:
    """Return whether an action takes its input; it may refuse it by an error of ours, and by nothing else."""
    with limited():
        try:
            action()
        except SynthRoadsError as error:
            text = str(error)
            assert text, "says nothing"
            assert text.isprintable(), f"not one printable line: {text[:300]!r}"
            assert len(text) < 2000, f"{len(text)} characters: {text[:300]!r}"
            return False
    return True


def cases(few: int, many: int, mark: pytest.MarkDecorator = pytest.mark.slow) -> pytest.MarkDecorator:
    """Return the mark that runs a test with an argument ``count`` on few cases, and under another mark on many."""
    many = pytest.param(many, id="many", marks=mark)
    return pytest.mark.parametrize("count", [pytest.param(few, id="few"), many])


def fuzz(few: int, many: int) -> pytest.MarkDecorator:
    """Return the mark that runs a test with an argument ``count`` on few cases, and by `make fuzz` on many."""
    return cases(few, many, pytest.mark.fuzz)


def for_all(strategy: st.SearchStrategy[Any], count: int, body: Callable[[Any], object]) -> None:
    """Run a body on a number of cases, the same in every run unless the environment has another FUZZ_SEED."""
    health = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]

    @settings(max_examples=count, suppress_health_check=health, database=None, derandomize=FUZZ_SEED is None)
    @given(strategy)
    def run(case: Any) -> None:
        body(case)

    (run if FUZZ_SEED is None else seed(int(FUZZ_SEED))(run))()


# --- values ---------------------------------------------------------------------------------------------------------


def wrong_values(documents: Sequence[Any]) -> st.SearchStrategy[Any]:
    """Return JSON data that differ from one of some documents in one to three places."""
    few = st.lists(_CHANGES, min_size=1, max_size=1)  # with more of them the first that is seen hides the others
    return st.builds(_changed, st.sampled_from(documents), few | few | st.lists(_CHANGES, min_size=2, max_size=3))


def _changed(document: Any, changes: list[tuple[int, Callable[..., None], Any]]) -> Any:
    root = [_copy(document)]
    for number, change, argument in changes:
        places = list(_places(root, 0, False))
        if places:  # hypothesis prefers small numbers: spread them over all places
            part, key, _ = places[number % len(places)]
            change(part, key, argument, places)
    return root[0]


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copy(item) for key, item in value.items()}
    return [_copy(item) for item in value] if isinstance(value, list | tuple) else value


def _places(part: Part, key: Any, named: bool) -> Iterator[tuple[Part, Any, bool]]:
    """Yield (container, key, whether the container is an object) of a value and all within it."""
    yield part, key, named
    value = part[key]
    if isinstance(value, dict):
        for inner in value:
            yield from _places(value, inner, True)
    elif isinstance(value, list):
        for place in range(min(len(value), 50)):
            yield from _places(value, place, False)


def _replace(part: Part, key: Any, value: Any, _: object) -> None:
    part[key] = _copy(value)


def _delete(part: Part, key: Any, _: object, __: object) -> None:
    del part[key]
    if isinstance(part, list) and not part:
        part.append(None)


def _rename(part: Part, key: Any, name: Any, _: object) -> None:
    if isinstance(part, dict):
        part[f"{key}{name}"] = part.pop(key)


def _add(part: Part, key: Any, name: Any, _: object) -> None:
    if isinstance(part, dict):
        part[str(name)] = part[key]
    else:
        part.append(_copy(part[key]))


def _scale(part: Part, key: Any, factor: Any, _: object) -> None:
    if isinstance(part[key], int | float):
        with suppress(OverflowError):  # a whole number that no float holds stays as it is
            scaled = part[key] * factor
            part[key] = scaled if factor % 1 else type(part[key])(scaled) if abs(factor) < 1e300 else scaled
    else:
        part[key] = factor


def _take_another(part: Part, key: Any, number: Any, places: list[tuple[Part, Any, bool]]) -> None:
    other, name, _ = places[number % len(places)]
    part[key] = _copy(other[name])


def _nest(part: Part, key: Any, depth: Any, _: object) -> None:
    value = part[key]
    for _level in range(depth):
        value = [value]
    part[key] = value


def _reverse(part: Part, key: Any, _: object, __: object) -> None:
    value = part[key]
    if isinstance(value, list):
        value.reverse()
    elif isinstance(value, dict):
        part[key] = list(value.items())
    elif isinstance(value, str):
        part[key] = value[::-1]
    elif isinstance(value, int | float):
        part[key] = -value


_FACTORS = (-1, 0, 2, 1e-3, 1e3, 1e6, 1e9, 0.999999, 1.000001, 1e-12, 1e300)
_CHANGES = st.one_of(
    *(
        st.tuples(st.integers(0, 2**31), st.just(change), argument)
        for change, argument in (
            (_replace, st.sampled_from(HOSTILE)),
            (_replace, st.floats(allow_nan=True) | st.integers() | st.text(max_size=8)),
            (_delete, st.none()),
            (_rename, st.sampled_from(["x", "\0", "_", " ", "s"])),
            (_add, st.sampled_from(["surplus", "+vendor", "", "\0", "length", "type", "x" * 5000])),
            (_scale, st.sampled_from(_FACTORS)),
            (_take_another, st.integers(0, 2**31)),
            (_nest, st.sampled_from([1, 2, 50, 400])),
            (_reverse, st.none()),
        )
    )
)


# --- bytes ----------------------------------------------------------------------------------------------------------


def json_files(documents: Sequence[Any]) -> st.SearchStrategy[bytes]:
    """Return JSON files with wrong values, or with damaged bytes."""
    texts = [json.dumps(document).encode() for document in documents]
    with_values = wrong_values(documents).map(lambda data: json.dumps(data).encode())
    twice = st.builds(_key_twice, st.sampled_from(documents), st.integers(0, 2**31))
    return st.one_of(with_values, with_values, with_values, damaged(texts, TOKENS), twice)


def yaml_files(documents: Sequence[Any]) -> st.SearchStrategy[bytes]:
    """Return YAML files with wrong values, or with damaged bytes."""
    import yaml

    texts = [yaml.safe_dump(document, sort_keys=False).encode() for document in documents]
    with_values = wrong_values(documents).map(lambda data: json.dumps(data).encode())  # YAML holds JSON
    return st.one_of(with_values, with_values, with_values, damaged(texts, TOKENS + YAML_TOKENS))


def damaged(files: Sequence[bytes], tokens: Sequence[bytes] = TOKENS, head: int = 400) -> st.SearchStrategy[bytes]:
    """Return files whose bytes differ from one of some files: cut, flipped, taken out, put in, encoded otherwise.

    Args:
        files: sound ones.
        tokens: what is put in.
        head: every second place lies within so many bytes from the start.
    """
    place = st.tuples(st.integers(0, 2**31), st.booleans(), st.just(head))
    changes = st.one_of(
        st.tuples(st.just(_cut), place, st.none()),
        st.tuples(st.just(_flip), place, st.integers(1, 255)),
        st.tuples(st.just(_insert), place, st.sampled_from(list(tokens))),
        st.tuples(st.just(_overwrite), place, st.sampled_from(_NUMBERS)),
        st.tuples(st.just(_take_out), place, st.integers(1, 300)),
        st.tuples(st.just(_repeat), place, st.integers(1, 300)),
        st.tuples(st.just(_encode), place, st.sampled_from(["utf-16", "utf-32", "latin-1", "utf-8-sig"])),
    )
    return st.builds(_damaged, st.sampled_from(list(files)), st.lists(changes, min_size=1, max_size=4))


_NUMBERS = [n.to_bytes(size, "little") for size in (2, 4, 8) for n in (0, 1, 256**size - 1, 256**size // 2, 10**4)]
_NUMBERS += [b"\x00\x00\x00\x00\x00\x00\xf8\x7f", b"\x00\x00\xc0\x7f", bytes(64)]  # NaN of both precisions


def _damaged(data: bytes, changes: list[tuple[Callable[..., bytes], tuple[int, bool, int], Any]]) -> bytes:
    for change, (number, near, head), argument in changes:
        reach = min(head, len(data)) if near else len(data)
        data = change(data, number % (reach + 1), argument)
    return data


def _cut(data: bytes, at: int, _: object) -> bytes:
    return data[:at]


def _flip(data: bytes, at: int, bits: int) -> bytes:
    return data[:at] + bytes([data[at] ^ bits]) + data[at + 1 :] if at < len(data) else data


def _insert(data: bytes, at: int, token: bytes) -> bytes:
    return data[:at] + token + data[at:]


def _overwrite(data: bytes, at: int, token: bytes) -> bytes:
    return data[:at] + token + data[at + len(token) :]


def _take_out(data: bytes, at: int, length: int) -> bytes:
    return data[:at] + data[at + length :]


def _repeat(data: bytes, at: int, length: int) -> bytes:
    return data[: at + length] + data[at:]


def _encode(data: bytes, _: int, encoding: str) -> bytes:
    return data.decode("utf-8", errors="replace").encode(encoding, errors="replace")


def _key_twice(document: Any, number: int) -> bytes:
    """Return a JSON text one of whose objects holds a key twice."""
    root = [_copy(document)]
    places = [(part, key) for part, key, named in _places(root, 0, False) if named]
    part, key = places[number % len(places)]
    text = json.dumps(root[0])
    member = f"{json.dumps(key)}: {json.dumps(part[key])}"
    return text.replace(member, f"{member}, {member}", 1).encode()
