"""Attributes that keep an object's parameters in a format without classes of its own for roads."""

from typing import Any

from ..road.objects import RoadObject
from ..road.things.thing import Thing


def attributes_of(item: RoadObject) -> dict[str, Any]:
    """Return an object's parameters as JSON data: its `instance` number first, its type as `object_type`.

    Furniture and structures have the ``class`` of their points beside it.
    """
    data = item.model_dump(mode="json", by_alias=True, exclude_none=True)
    attributes = {"instance": data.pop("instance"), "object_type": data.pop("type")}
    if isinstance(item, Thing):
        attributes["class"] = item.semantic_class
        data.pop("class_name", None)
    return attributes | data
