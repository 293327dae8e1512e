"""All scan patterns: those of the files beside this one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from ...base.discovery import discover_models
from .base import Pattern

PATTERNS = discover_models(__package__, Pattern, "type")
"""Name, as presets have it, and model of every scan pattern."""

if TYPE_CHECKING:
    PatternModel = Pattern
else:
    PatternModel = Annotated[Union[tuple(PATTERNS.values())], Field(discriminator="type")]  # noqa: UP007
