"""The frame of an IFC file: project, units, contexts, map coordinates, site."""

from __future__ import annotations

import re

from ...base.crs import wkt
from ...road.parameters import RoadParameters
from .entities import Entity, IfcFile

_PRECISION = 1e-6  # m, within which viewers take points as one


def write_project(ifc: IfcFile, parameters: RoadParameters) -> Entity:
    """Add project, units, contexts and georeferencing; return the IfcSite."""
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
    ifc.project = ifc.rooted(
        "IfcProject",
        "project",
        Name=metadata.identifier,
        LongName=metadata.title or None,
        RepresentationContexts=[model],
        UnitsInContext=ifc.add("IfcUnitAssignment", units),
    )
    _georeference(ifc, parameters, model, units[0])
    site = ifc.rooted("IfcSite", "site", Name="site", ObjectPlacement=ifc.local_frame, CompositionType="ELEMENT")
    ifc.gather("IfcRelAggregates", ifc.project, [site])
    about = {
        "identifier": ifc.value(metadata.identifier),
        "seed": ifc.value(metadata.seed),
        "generator": ifc.value(metadata.generator),
        "design_class": ifc.value(parameters.design_class),
        "referenceSystem": ifc.value(metadata.referenceSystem),
        "translate": ifc.value(parameters.transform.translate),
    }
    ifc.properties(ifc.project, "SynthRoads", about)
    return site


def _contexts(ifc: IfcFile) -> Entity:
    """Add the contexts that shapes belong to; north is +y."""
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
    """Say where on the map the local frame lies: x east, y north, z up, not turned and not scaled.

    So the file's coordinates stay small, and the map's origin is kept in float64.
    """
    text = wkt(parameters.metadata.epsg)
    names = {key: _quoted_name(text, key) for key in ("DATUM", "VERT_DATUM", "PROJECTION")}
    title = re.search(r'"([^"]*)"', text)
    target = ifc.add(
        "IfcProjectedCRS",
        Name=f"EPSG:{parameters.metadata.epsg}",
        Description=title[1] if title else None,
        GeodeticDatum=names["DATUM"],
        VerticalDatum=names["VERT_DATUM"],
        MapProjection=names["PROJECTION"],
        MapUnit=metre,
    )
    east, north, height = parameters.transform.translate
    ifc.add("IfcMapConversion", model, target, east, north, height, 1.0, 0.0, 1.0)


def _quoted_name(text: str, key: str) -> str | None:
    """Return the name that stands behind a keyword of well-known text."""
    found = re.search(rf'\b{key}\["([^"]*)"', text)
    return found[1] if found else None
