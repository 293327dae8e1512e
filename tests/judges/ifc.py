"""IFC, judged by ifcopenshell's validator."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import CodeType, SimpleNamespace
from typing import Any
from unittest import mock

from tests.judges.samples import Samples


def issues(file: Any, express_rules: bool = True) -> list[str]:
    """Return what ifcopenshell's validator finds in an open file: schema, and the standard's rules."""
    import ifcopenshell.validate

    log = ifcopenshell.validate.json_logger()
    with _rules_compiled_once():
        ifcopenshell.validate.validate(file, log, express_rules=express_rules)
    return [f"{item['level']}: {item['message'][:300]}" for item in log.statements]


@contextmanager
def _rules_compiled_once() -> Iterator[None]:
    """Let the validator keep the standard's rules: compiling them for each file takes three quarters of its time.

    Pytest would have their assertions say what they compared, which takes four seconds; the rule is named without.
    """
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
    """Return rules' code, whose assertions have the message that the validator expects."""
    code: CodeType = compile(re.sub(r"(?m)^(\s+assert .*)$", r'\1, "it does not hold"', source), name, mode)
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
