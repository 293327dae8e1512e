"""IFC, judged by ifcopenshell's validator."""

from __future__ import annotations

import ast
import hashlib
import marshal
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import CodeType, SimpleNamespace
from typing import Any
from unittest import mock

from tests.judges.samples import Samples

CACHE = Path(__file__).parents[2] / ".pytest_cache" / "ifc-rules"


def issues(file: Any, express_rules: bool = True) -> list[str]:
    """Return what ifcopenshell's validator finds in an open file: schema, and the standard's rules."""
    import ifcopenshell.validate

    log = ifcopenshell.validate.json_logger()
    with _rules_compiled_once():
        ifcopenshell.validate.validate(file, log, express_rules=express_rules)
    return [f"{item['level']}: {item['message'][:300]}" for item in log.statements]


@contextmanager
def _rules_compiled_once() -> Iterator[None]:
    """Let the validator keep the standard's rules: compiling them for each file takes three quarters of its time."""
    from _pytest.assertion import rewrite
    from ifcopenshell.express import rule_executor

    with (
        mock.patch.object(rule_executor, "ast", SimpleNamespace(parse=lambda source: source)),
        mock.patch.object(rewrite, "rewrite_asserts"),
        mock.patch.object(rule_executor, "compile", _compiled, create=True),
    ):
        yield


@cache
def _compiled(source: str, name: str, mode: str) -> CodeType:
    """Return rules' code whose assertions say what they compared; it is kept among what pytest keeps of its own."""
    import pytest
    from _pytest.assertion import rewrite

    made_of = [source, name, mode, pytest.__version__, sys.version]
    kept = CACHE / hashlib.sha256("\0".join(made_of).encode()).hexdigest()
    with suppress(OSError, ValueError, EOFError, TypeError):
        return marshal.loads(kept.read_bytes())
    tree = ast.parse(source)
    rewrite.AssertionRewriter(None, None, source.encode()).run(tree)
    code = compile(tree, name, mode)
    with suppress(OSError):
        CACHE.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}")
        part.write_bytes(marshal.dumps(code))
        part.replace(kept)
    return code


def verdict(samples: Samples) -> list[str]:
    """Return what the validator finds."""
    import ifcopenshell

    return issues(ifcopenshell.open(str(samples.file("twin.ifc"))))


def with_a_negative_length(samples: Samples) -> Samples:
    """Return files with an IFC whose alignment has an element shorter than nothing: a rule of the standard."""
    import ifcopenshell

    file = ifcopenshell.open(str(samples.file("twin.ifc")))
    file.by_type("IfcAlignmentHorizontalSegment")[0].SegmentLength = -1.0
    return samples.with_file("twin.ifc", file.to_string().encode())
