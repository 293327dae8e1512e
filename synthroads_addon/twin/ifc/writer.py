"""A road as IFC 4.3 (IFC4X3_ADD2): alignment, road parts, pavement, markings, furniture, structures, surroundings.

Coordinates are local (x east, y north, z up); an IfcMapConversion says where they lie on the map. `docs/twin-ifc.md`
has the table of what becomes what.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from ...base.errors import InputError
from ...base.progress import Progress, part_of, silent
from ...road.geometry import RoadGeometry
from ...road.objects import PointObject
from ...road.parameters import RoadParameters
from ..surfaces import road_stations
from ..trace import LEVEL, Trace
from .alignment import write_alignment
from .entities import Entity, IfcFile
from .road import write_carriageways, write_markings, write_road
from .scene import STAGE, Scene
from .surroundings import write_surroundings
from .things import write_things

_LONGEST = 200_000.0
"""Longest road that is written as one file, m: as long as scenarios can be."""
_SHORTEST = 1e-3
"""Shortest road, m: lengths have six decimals."""
_SHORTEST_ELEMENT = 1e-6
"""Shortest element of an axis, m."""


_SHARES = (0.15, 0.05, 0.25, 0.35)
"""Of the time, what carriageways, markings, things and surroundings take; the file's own writing takes the rest."""


def write_ifc(
    parameters: RoadParameters,
    path: Path,
    tolerance: float = 0.005,
    placement: Literal["linear", "local"] = "linear",
    progress: Progress = silent,
) -> Trace:
    """Write a road as IFC 4.3, the same bytes for the same road; return the trace of what became of each object.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of the road's surfaces, m; their vertices are exact.
        placement: what says where an object stands: a place along the alignment (``linear``), which few viewers read,
            or coordinates (``local``).
        progress: receives the stage's name and the share of the work that is done.

    Raises:
        InputError: ifcopenshell isn't installed, the map coordinate system is unknown, the road is too long or too
            short, or an element of its axis is shorter than a micrometre.
    """
    if parameters.alignment.length < _SHORTEST:
        raise InputError("alignment: length", parameters.alignment.length, "an IFC file holds a millimetre or more")
    if parameters.alignment.length > _LONGEST:
        raise InputError("alignment: length", parameters.alignment.length, "an IFC file holds up to 200 km (200000 m)")
    for number, element in enumerate(parameters.alignment.horizontal):
        if element.length < _SHORTEST_ELEMENT:  # whose curvature's rate may be no finite number
            field = f"alignment: horizontal {number}: length"
            raise InputError(field, element.length, "an element in an IFC file has a micrometre or more")
    geometry = RoadGeometry(parameters)
    ifc = IfcFile(parameters.metadata.road_identifier, Trace(geometry, within=("dash",)))
    site = write_project(ifc, parameters)
    scene = Scene(
        ifc=ifc,
        geometry=geometry,
        axis=write_alignment(ifc, geometry),
        tolerance=tolerance,
        stations=road_stations(geometry, tolerance),
        site=site,
        road=write_road(ifc, parameters, site),
        along_axis=placement == "linear",
    )
    scene.cache_surface((item.station, item.offset) for item in parameters.of_type(PointObject).values())
    done_share = 0.0
    for share, write in zip(
        _SHARES, (write_carriageways, write_markings, write_things, write_surroundings), strict=True
    ):
        write(scene, part_of(progress, done_share, done_share + share))
        done_share += share
        progress(STAGE, done_share)
    ifc.write_relations()
    ifc.write(path, parameters.metadata.identifier, parameters.metadata.generator)
    return ifc.trace


_PRECISION = 1e-6  # m, within which viewers take points as one


def write_project(ifc: IfcFile, parameters: RoadParameters) -> Entity:
    """Add IfcProject, units, contexts and georeferencing to the file; return the IfcSite."""
    model = _contexts(ifc)
    units = [
        ifc.add("IfcSIUnit", None, kind, None, name)
        for kind, name in (
            ("LENGTHUNIT", "METRE"),
            ("AREAUNIT", "SQUARE_METRE"),
            ("VOLUMEUNIT", "CUBIC_METRE"),
            ("PLANEANGLEUNIT", "RADIAN"),
        )
    ]
    metadata = parameters.metadata
    ifc.project = ifc.add_root(
        "IfcProject",
        "project",
        Name=metadata.identifier,
        LongName=metadata.title or None,
        RepresentationContexts=[model],
        UnitsInContext=ifc.add("IfcUnitAssignment", units),
    )
    _georeference(ifc, parameters, model, units[0])
    site = ifc.add_root("IfcSite", "site", Name="site", ObjectPlacement=ifc.local_frame, CompositionType="ELEMENT")
    ifc.note_relation("IfcRelAggregates", ifc.project, [site])
    values = {
        "identifier": ifc.value(metadata.identifier),
        "seed": ifc.value(metadata.seed),
        "generator": ifc.value(metadata.generator),
        "design_class": ifc.value(parameters.design_class),
        "level_of_detail": ifc.value(LEVEL),
        "referenceSystem": ifc.value(metadata.referenceSystem),
        "translate": ifc.value(parameters.transform.translate),
    }
    if metadata.heightReferenceSystem:
        values["heightReferenceSystem"] = ifc.value(metadata.heightReferenceSystem)
    ifc.add_properties(ifc.project, "SynthRoads", values)
    return site


def _contexts(ifc: IfcFile) -> Entity:
    """Add the geometric representation contexts (true north +y); return the model context."""
    model = ifc.add(
        "IfcGeometricRepresentationContext", None, "Model", 3, _PRECISION, ifc.flat_axes, ifc.direction(0.0, 1.0)
    )
    for name, view in (("Body", "MODEL_VIEW"), ("Axis", "GRAPH_VIEW")):
        ifc.contexts[name] = ifc.add(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier=name,
            ContextType="Model",
            ParentContext=model,
            TargetView=view,
        )
    return model


def _georeference(ifc: IfcFile, parameters: RoadParameters, model: Entity, metre: Entity) -> None:
    """Add the projected coordinate system and the IfcMapConversion from local to map coordinates.

    So the file's coordinates stay small, and the map's origin is kept in float64.
    """
    metadata = parameters.metadata
    text = metadata.system.to_wkt()
    names = {key: _quoted_name(text, key) for key in ("DATUM", "VERT_DATUM", "PROJECTION")}
    title = re.search(r'"([^"]*)"', text)
    target = ifc.add(
        "IfcProjectedCRS",
        Name=f"EPSG:{metadata.code}",
        Description=title[1] if title else None,
        GeodeticDatum=names["DATUM"],
        VerticalDatum=names["VERT_DATUM"],
        MapProjection=names["PROJECTION"],
        MapUnit=metre,
    )
    east, north, height = parameters.transform.translate
    ifc.add("IfcMapConversion", model, target, east, north, height, 1.0, 0.0, 1.0)


def _quoted_name(text: str, key: str) -> str | None:
    """Return the quoted name after a keyword in WKT, or None if the keyword is missing."""
    match = re.search(rf'\b{key}\["([^"]*)"', text)
    return match[1] if match else None
