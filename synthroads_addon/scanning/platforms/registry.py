"""All platforms: those of the files beside this one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...base.discovery import discover_models, discriminated_union
from ...base.schema import ClosedModel
from .platform import Platform

PLATFORMS = discover_models(__package__, Platform, "kind")
"""Kind and model of every platform."""

if TYPE_CHECKING:
    PlatformModel = Platform
else:
    PlatformModel = discriminated_union(PLATFORMS, "kind")


class _Carrier(ClosedModel):
    platform: PlatformModel


def make_platform(kind: str = next(iter(PLATFORMS)), **values: Any) -> Platform:
    """Return a platform of a kind with these field values; other fields keep their defaults.

    Raises:
        InputError: there is no such kind, it has no such field, or a value is out of its limits.

    Example:
        >>> platform = make_platform("uav", height=60.0, speed=5.0)
        >>> platform.height, platform.speed
        (60.0, 5.0)
    """
    return _Carrier.from_dict({"platform": {"kind": kind, **values}}, source="scan").platform
