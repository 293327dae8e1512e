"""All things of a road: those of the files beside this one."""

from __future__ import annotations

from ...base.discovery import discover_models
from .thing import Thing

THINGS = discover_models(__package__, Thing, "type")
"""Type in the parameter set and model of every thing."""
