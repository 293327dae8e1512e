"""CityJSON, judged by the official schema and by cjio."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np

from tests.judges.samples import Samples

if TYPE_CHECKING:
    import jsonschema_rs

BESIDE = "../shared/standards/cityjson-2.0.2.min.schema.json"
"""Where the schema is looked for, from the repository's folder."""
VARIABLE = "SYNTHROADS_CITYJSON_SCHEMA"
"""Environment variable with another path of the schema."""
_STATIONS = np.array([100.3, 300.0, 471.9])


def schema_path() -> Path:
    """Return where the schema should be."""
    return Path(os.environ.get(VARIABLE) or Path(__file__).resolve().parents[2] / BESIDE)


def official_schema() -> dict[str, Any]:
    """Return the schema."""
    return json.loads(schema_path().read_text(encoding="utf-8"))


def version() -> str | None:
    """Return the schema's version, which its address has; None if it isn't there."""
    return official_schema()["$id"].split("/")[-2] if schema_path().is_file() else None


def verdict(samples: Samples) -> list[str]:
    """Return the objects that don't fit the schema."""
    import jsonschema_rs

    schema = jsonschema_rs.Draft7Validator(official_schema())
    return unfitting_objects(schema, json.loads(samples.text("twin.city.json")))


def unfitting_objects(schema: jsonschema_rs.Draft7Validator, data: dict[str, Any]) -> list[str]:
    """Return the ids of a file's objects that don't fit the schema, "the file" if it is none of these.

    Nothing is asked for the reasons: of a choice among 34 types of objects these are gigabytes.
    """
    if schema.is_valid(data):
        return []
    objects = data["CityObjects"].items()
    # An object points to vertices by numbers that no schema can follow: to ask of each object for all would take long.
    rest = data | {"vertices": []}
    return [name for name, item in objects if not schema.is_valid(rest | {"CityObjects": {name: item}})] or ["the file"]


def with_wrong_semantics(samples: Samples) -> Samples:
    """Return files with a CityJSON in which a lane is of a type that no surface has."""
    return samples.with_text("twin.city.json", '"type":"TrafficArea"', '"type":"TrafficLane"')


@contextmanager
def cjio_reader() -> Iterator[Any]:
    """Yield the module that reads CityJSON.

    Importing it makes the whole process write every float of JSON with six decimals: what it replaces is put back.
    """
    with mock.patch.multiple(json.encoder, c_make_encoder=json.encoder.c_make_encoder, float=float, create=True):
        from cjio import cityjson

        yield cityjson


def cjio_verdict(samples: Samples) -> list[str]:
    """Return what cjio reads that isn't in the parameters: vertices, coordinate system, centreline, lanes' widths."""
    from tests.helpers.files.cityjson_files import City

    with cjio_reader() as reader, samples.file("twin.city.json").open(encoding="utf-8") as file:
        model = reader.reader(file)
        found = []
        count = len(model.j["vertices"])
        model.remove_duplicate_vertices()
        model.remove_orphan_vertices()
        if len(model.j["vertices"]) != count:
            found.append(f"{count - len(model.j['vertices'])} vertices are there twice or of no use")
        if model.get_epsg() != samples.road.metadata.epsg:
            found.append(f"its coordinate system is EPSG:{model.get_epsg()}")
        model.decompress()
        city = City(model.j, np.array(model.j["vertices"]))
        roads = set(model.get_subset_cotype(["Road"]).j["CityObjects"])
    if roads != {name for name, item in city.objects.items() if item["type"] == "Road"}:
        found.append(f"its roads are {sorted(roads)}")
    return found + _off_axis(samples, city) + _wrong_widths(samples, city)


def _off_axis(samples: Samples, city: Any) -> list[str]:
    """Return whether the centreline is as long as the alignment, and lies on it."""
    axis = next(name for name, item in samples.road.objects.items() if item is samples.road.alignment)
    (line,) = city.objects[axis]["geometry"][0]["boundaries"]
    plan = city.vertices[line, :2]
    length = np.linalg.norm(np.diff(plan, axis=0), axis=1).sum()
    _, offset = samples.geometry.alignment.project(plan - samples.road.transform.translate[:2])
    # Chords are shorter than the arc; at this tolerance by millimetres on the whole road.
    if abs(length - samples.geometry.length) > 0.02 or np.abs(offset).max() > 1e-3:
        return [f"the centreline is {length:.3f} m long and up to {np.abs(offset).max():.4f} m off"]
    return []


def _wrong_widths(samples: Samples, city: Any) -> list[str]:
    """Return the lanes that aren't as wide as in the parameters, at some stations."""
    from tests.helpers.files.cityjson_files import width_at

    found = []
    for side, section in samples.geometry.sections.items():
        for _, about, rings in city.surfaces("TrafficArea"):
            if about["instance"] != section.carriageway.instance or about["strip"] != "lane":
                continue
            for station, boundaries in zip(_STATIONS, section.lane_boundaries(_STATIONS), strict=True):
                wanted = boundaries[about["lane"]] - boundaries[about["lane"] + 1]
                width = width_at(samples.road, rings, float(station))
                if abs(width - wanted) > 1e-3:
                    found.append(f"{side} lane {about['lane']} is {width:.4f} m wide at {station} m, not {wanted:.4f}")
    return found


def with_a_moved_vertex(samples: Samples) -> Samples:
    """Return files with a CityJSON in which two vertices are one."""
    data = json.loads(samples.text("twin.city.json"))
    data["vertices"][1] = data["vertices"][0]
    return samples.with_file("twin.city.json", json.dumps(data).encode())
