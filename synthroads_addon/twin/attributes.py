"""Attributes that keep an object's parameters in a format without classes of its own for roads."""

from __future__ import annotations

from typing import Any

from ..road.objects import LineObject, PointObject, RoadObject
from ..road.section import Marking


def attributes_of(item: RoadObject) -> dict[str, Any]:
    """Return an object's parameters as JSON data, ``instance`` first; its type is ``object_type``.

    Furniture and structures have the ``class`` of their points beside it.
    """
    data = item.model_dump(mode="json", by_alias=True, exclude_none=True)
    attributes = {"instance": data.pop("instance"), "object_type": data.pop("type")}
    if isinstance(item, LineObject | PointObject) and not isinstance(item, Marking):
        attributes["class"] = data.pop("class_name", item.points_class)
    return attributes | data
