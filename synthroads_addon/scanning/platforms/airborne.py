"""An aircraft."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field

from .moving import AerialPlatform


class Aircraft(AerialPlatform):
    """Aircraft that flies level along the road, usually 800 m up at 60 m/s."""

    order: ClassVar[int] = 3
    label: ClassVar[str] = "Aircraft"
    usual: ClassVar[Mapping[str, Any]] = {"height": 800.0, "speed": 60.0, "lateral_offsets": (0.0,)}

    kind: Literal["airborne"] = Field("airborne", title="Platform", description="Platform.")
