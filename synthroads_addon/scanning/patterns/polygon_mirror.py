"""A polygon of mirrors."""

from __future__ import annotations

from typing import ClassVar, Literal

from .line import LinePattern


class PolygonMirror(LinePattern):
    """A polygon of mirrors, each of whose facets sweeps the whole field of view with every pulse."""

    order: ClassVar[int] = 2
    type: Literal["polygon_mirror"] = "polygon_mirror"
