"""A hand-made road to put objects on."""

from __future__ import annotations

from typing import Any

Data = dict[str, Any]


def road_data(objects: Data, length: float = 300.0, curvature: float = 1 / 1200, grade: float = 0.03) -> Data:
    """Return an RQ 31 in a curve to the left, rising, both carriageways falling to the inside."""
    curve = {"kind": "arc", "length": length, "curvature_start": curvature, "curvature_end": curvature}
    made: Data = {
        "axis": {
            "type": "Alignment",
            "start_x": 0.0,
            "start_y": 0.0,
            "start_heading_deg": 30.0,
            "horizontal": [curve],
            "vertical": [{"station": 0.0, "elevation": 0.0}, {"station": length, "elevation": grade * length}],
        },
        "median": {"type": "Median"},
        "terrain": {
            "type": "Terrain",
            "half_width": 60.0,
            "embankment_height": 2.0,
            "undulation": 0.5,
            "wavelength": 60.0,
            "seed": 1,
        },
    }
    for side in ("left", "right"):
        made[side] = {
            "type": "Carriageway",
            "side": side,
            "inner_offset": 2.0,
            "hard_shoulder_width": 3.0,
            "outer_edge_strip_width": 0.75,
            "inner_edge_strip_width": 0.75,
            "verge_width": 1.5,
            "lanes": [{"width": 3.75}, {"width": 3.75}],
            "crossfall": [{"station": 0.0, "crossfall_percent": -4.0}],
        }
    made |= objects
    for number, item in enumerate(made.values(), 1):
        item["instance"] = number
    metadata = {"identifier": "hand-made", "seed": 0, "generator": "a hand"}
    metadata["referenceSystem"] = "https://www.opengis.net/def/crs/EPSG/0/25832"
    head = {"type": "RoadParameters", "version": "1.0", "metadata": metadata, "design_class": "EKA1A"}
    return head | {"transform": {"translate": [294000.0, 5628000.0, 180.0]}, "objects": made}
