"""A UAV."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field

from .moving import AerialPlatform


class Uav(AerialPlatform):
    """UAV that flies level along the road, usually 60 m up at 8 m/s."""

    order: ClassVar[int] = 0
    label: ClassVar[str] = "UAV"
    usual: ClassVar[Mapping[str, Any]] = {"height": 60.0, "speed": 8.0, "lateral_offsets": (10.0, -10.0)}

    kind: Literal["uav"] = Field("uav", title="Platform", description="Platform.")
