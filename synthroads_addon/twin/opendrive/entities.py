"""Elements of an OpenDRIVE file that bear an instance number as user data."""

from __future__ import annotations

from ..trace import Entity, Trace
from .xml import Element

LOST = {
    "Terrain": "OpenDRIVE has no ground beside its lanes",
    "Landscape": "OpenDRIVE has no ground beside its lanes",
    "strip": "OpenDRIVE has no areas of grass",
    "Vehicle": "OpenDRIVE has no traffic: scenarios are for that (OpenSCENARIO)",
    "RampVehicle": "OpenDRIVE has no traffic: scenarios are for that (OpenSCENARIO)",
    "RampGuardrail": "guardrails of ramps and crossing roads aren't written as objects of their roads",
    "rut": "OpenDRIVE has no damage in its surface: OpenCRG is for that",
    "pothole": "OpenDRIVE has no damage in its surface: OpenCRG is for that",
    "patch": "OpenDRIVE has no damage on its surface",
    "crack": "OpenDRIVE has no damage on its surface",
    "removed": "OpenDRIVE has no traces of markings that were ground off",
}
"""Type of object, or kind of part -> why the file has none."""


def trace_elements(root: Element, trace: Trace) -> None:
    """Record in the trace every element below a `road` that has an instance number as user data.

    An element is identified by tag and id; lanes and road marks by road, start of the section (m), lane, and number
    of the mark among the lane's. What is only named at the file's end is no element.
    """
    for road in root.findall("road"):
        _trace_element(road, {}, trace)


def _trace_element(element: Element, parent_keys: Entity, trace: Trace) -> None:
    """Record an element and those below it that have an instance number, by the keys that identify them."""
    keys = _entity_keys(element, parent_keys)
    for data in element.findall("userData"):
        if data.get("code") == "instance":
            trace.record_entity(int(data.get("value", "0")), **keys)
    marks = 0
    for child in element:
        if child.tag == "roadMark":
            _trace_element(child, {**keys, "mark": marks}, trace)
            marks += 1
        elif child.tag != "userData":
            _trace_element(child, keys, trace)


def _entity_keys(element: Element, parent_keys: Entity) -> Entity:
    """Return the keys that identify an element in the report: its ancestors', its tag, and its id or section."""
    entity = {**parent_keys, "element": element.tag}
    if element.tag == "laneSection":
        entity["section"] = float(element.get("s", "0"))
    elif element.tag in ("road", "lane"):
        entity[element.tag] = int(element.get("id", "0"))
    elif "id" in element.attrib and element.tag in ("object", "signal", "tunnel"):
        entity["id"] = int(element.get("id", "0"))
    return entity
