"""The road in IFC 4.3: its lateral parts, what they are paved with, and the markings on it.

Spatially an IfcRoad has a ROADWAYPLATEAU per direction (CARRIAGEWAY with its TRAFFICLANEs, HARDSHOULDER, SOFTSHOULDER,
turnouts), a CENTRALRESERVE, and a ROADSIDE on either side. Physically each direction has one IfcPavement, an aggregate
of one IfcCourse per strip, which its part refers to; verge and median are IfcEarthworksFills. Markings are
IfcSurfaceFeatures that adhere to their carriageway's pavement, not contained in any part.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...base.progress import Progress
from ...road.damage import damage_columns, damage_depth, damaged_strips
from ...road.geometry import SurfaceStrip
from ...road.guidelines import LIMITS
from ...road.objects import AnyWidth, RoadObject
from ...road.other_roads.parts import CrossingRoad
from ...road.parameters import RoadParameters
from ...road.pavement.cover import MarkingFilms
from ...road.pavement.joints import joint_width, joints_of
from ...road.section import (
    Arrow,
    Carriageway,
    Crack,
    Hatching,
    LineMarking,
    Median,
    Overlay,
    Patch,
    Pavement,
    Pothole,
    RemovedMarking,
    Rut,
    Settlement,
    SurfaceShape,
    Turnout,
)
from ...road.section_geometry import CarriagewaySection
from ...road.streets.street_geometry import STREET_STRIPS, StreetShape
from ...road.turnout_geometry import TURNOUT_STRIPS, TurnoutShape
from ..faces import Faces, join_faces
from ..network import PARTS, network_roads
from ..side_roads import side_road_faces, side_road_paint_faces
from ..surfaces import damaged_surface, dash_surfaces, joint_surface, painted_surface
from .entities import Entity, Float, IfcFile, rounded
from .scene import STAGE, Scene, grid_triangles

_NARROWEST = 1e-4
"""A strip that is nowhere wider (m) isn't there."""
_POINTED = 1e-5
"""Where a strip is narrower (m) it ends in a point: readers take corners so near for one, and its faces for faulty."""
_SIDES = ("left", "right")
_PART_TYPES = {
    "lane": "TRAFFICLANE",
    "turnout_lane": "TRAFFICLANE",
    "hard_shoulder": "HARDSHOULDER",
    "turnout_shoulder": "HARDSHOULDER",
    "verge": "SOFTSHOULDER",
    "island": "TRAFFICISLAND",
    "gore": "TRAFFICISLAND",
    "bay": "LAYBY",
    "parking_bay": "PARKINGBAY",
    "footway": "SIDEWALK",
}
"""Kind of strip -> type of its road part; the others, edge strips, have none in IFC."""
_STREET_ENTITIES = {"kerb": ("IfcKerb", "USERDEFINED"), "footway": ("IfcPavement", "USERDEFINED")}
"""Kind of a street side's strip -> class and type of its surface."""
_TURNOUT_TYPES = {
    "emergency_bay": "LAYBY",
    "bus_bay": "BUS_STOP",
    "layby": "LAYBY",
    "exit": "ROADSEGMENT",
    "entry": "ROADSEGMENT",
}


def write_road(ifc: IfcFile, parameters: RoadParameters, site: Entity) -> Entity:
    """Add and return the IfcRoad with the design criteria that hold for all of it."""
    name = parameters.metadata.identifier
    road = ifc.add_root(
        "IfcRoad", "road", Name=name, LongName=parameters.metadata.title or None, ObjectPlacement=ifc.local_frame,
        CompositionType="ELEMENT",
    )  # fmt: skip
    ifc.note_relation("IfcRelAggregates", site, [road])
    lanes = [len(carriageway.lanes) for carriageway in parameters.of_type(Carriageway).values()]
    design = {
        "DesignSpeed": ifc.add("IfcLinearVelocityMeasure", rounded(LIMITS[parameters.design_class].speed / 3.6)),
        "NumberOfThroughLanes": ifc.add("IfcCountMeasure", sum(lanes)),
        "RoadDesignClass": ifc.add("IfcLabel", parameters.design_class),
    }
    ifc.add_properties(road, "Pset_RoadDesignCriteriaCommon", design)
    return road


def write_carriageways(scene: Scene, progress: Progress) -> None:
    """Add roadsides, carriageways with pavement and damage, and the median; fill in `scene.parts`."""
    for side in _SIDES:
        # With a slash, as no object's id has one.
        scene.parts[f"roadside-{side}"] = _part(scene, scene.road, f"road/roadside-{side}", "ROADSIDE")
    carriageways = scene.geometry.parameters.of_type(Carriageway)
    for number, (name, carriageway) in enumerate(carriageways.items(), 1):
        _CarriagewayWriter(scene, name, carriageway).write()
        progress(STAGE, number / len(carriageways))
    for name, mouth in scene.geometry.mouths.items():
        carriageway = mouth.section.carriageway
        faces = {kind: side_road_faces(scene.geometry, mouth, kind) for kind in PARTS[:2]}
        faces["paint"] = side_road_paint_faces(scene.geometry, mouth)
        _write_side_road(scene, name, mouth.side_road, faces, ("INTERSECTION", "side road", carriageway.pavement))
    for road in network_roads(scene.geometry):
        word = "crossing road" if isinstance(road.item, CrossingRoad) else "ramp"
        _write_side_road(scene, road.name, road.item, road.faces, ("ROADSEGMENT", word, Pavement()))
    _write_median(scene)


def _part(
    scene: Scene, whole: Entity, name: str, kind: str, usage: str = "LATERAL", object_type: str | None = None
) -> Entity:
    """Add and return an IfcRoadPart of the road or of one of its parts."""
    part = scene.ifc.add_product("IfcRoadPart", name, kind, object_type, CompositionType="PARTIAL", UsageType=usage)
    scene.ifc.note_relation("IfcRelAggregates", whole, [part])
    return part


@dataclass(frozen=True)
class _Piece:
    """A strip of a carriageway, or the piece of one that belongs to a turnout, that becomes a road part.

    Attributes:
        name: of its part and its course.
        index, kind: of its section's strips.
        strip: whose class and material it has.
        whole: the road part that its own is a part of.
        instance: number of its faces.
        start, end: stations, m.
        width: as the parameter set gives it; None where it follows from the turnout.
    """

    name: str
    index: int
    kind: str
    strip: SurfaceStrip
    whole: Entity
    instance: int
    start: float
    end: float
    width: AnyWidth | None


class _CarriagewayWriter:
    """Writer of one carriageway's road parts, pavement and damage."""

    def __init__(self, scene: Scene, name: str, carriageway: Carriageway) -> None:
        self.scene, self.ifc, self.name, self.carriageway = scene, scene.ifc, name, carriageway
        self.section = scene.geometry.sections[carriageway.side]
        self._damaged_strips = set(damaged_strips(self.section))
        self._damages: list[SurfaceShape] = [*carriageway.pavement.ruts, *carriageway.pavement.potholes]
        self._damages += [*(carriageway.pavement.settlements or ()), *(carriageway.pavement.overlays or ())]
        self._undamaged_section = _with_damages(self.section, ())
        self.turnouts = {
            shape.turnout.instance: key
            for shape in self.section.turnouts
            for key, item in scene.geometry.parameters.objects.items()
            if item is shape.turnout
        }

    def write(self) -> None:
        """Add the carriageway's road parts, its pavement, a course for each strip, and the damage."""
        scene, carriageway = self.scene, self.carriageway
        self.plateau = _part(scene, scene.road, f"{self.name}/plateau", "ROADWAYPLATEAU")
        self.part = _part(scene, self.plateau, self.name, "CARRIAGEWAY")
        scene.parts[f"carriageway-{carriageway.side}"] = self.part
        scene.add_parameters(self.part, carriageway)
        pieces = list(self._pieces())
        pavement_type = "RIGID" if carriageway.pavement.is_concrete else "FLEXIBLE"
        self.pavement = self.ifc.add_product("IfcPavement", self.name, pavement_type, Name=f"{self.name}/pavement")
        self.ifc.note_relation("IfcRelContainedInSpatialStructure", self.part, [self.pavement])
        self.ifc.add_labels(self.pavement, carriageway.instance, carriageway.points_class, carriageway.pavement)
        scene.parts[f"pavement-{carriageway.side}"] = self.pavement
        for piece in pieces:
            self._write_piece(piece)
        self._write_damage()
        self._write_joints()

    def _pieces(self) -> Iterator[_Piece]:
        """Yield every strip of the carriageway as a piece of the road's length, and those of turnouts one per turnout.

        Adds the turnouts' road parts first, because their pieces are aggregated by them.
        """
        strips = [strip for strip in self.scene.geometry.strips if strip.side == self.carriageway.side]
        if self.carriageway.side == "left":
            strips = strips[::-1]
        length, lanes, lane = self.scene.geometry.length, len(self.carriageway.lanes), 0
        wholes = {instance: self._turnout(key) for instance, key in self.turnouts.items()}
        streets = [(shape, self._street(shape)) for shape in self.section.streets]
        for index, strip in enumerate(strips):
            kind = strip.kind
            if kind in STREET_STRIPS:
                yield from self._street_pieces(index, strip, streets)
                continue
            if kind in TURNOUT_STRIPS:
                yield from self._turnout_pieces(index, strip, wholes)
                continue
            name, width = f"{self.name}/{kind}", getattr(self.carriageway, f"{kind}_width", None)
            if kind == "lane":
                # Lanes are counted from outside, as the parameter set lists them.
                lane += 1
                name, width = f"{self.name}/lane-{lanes - lane}", self.carriageway.lanes[lanes - lane].width
            whole = self.plateau if kind in ("hard_shoulder", "verge") else self.part
            yield _Piece(name, index, kind, strip, whole, strip.instance, 0.0, length, width)

    def _turnout(self, name: str) -> Entity:
        """Add and return the IfcRoadPart of a turnout."""
        turnout = self.scene.geometry.parameters.objects[name]
        assert isinstance(turnout, Turnout)
        part = _part(self.scene, self.plateau, name, _TURNOUT_TYPES[turnout.kind], "REGION", turnout.kind)
        self.scene.add_parameters(part, turnout)
        return part

    def _street(self, shape: StreetShape) -> tuple[str, Entity]:
        """Add the IfcRoadPart of a street side; return its name and the part."""
        objects = self.scene.geometry.parameters.objects
        name = next(name for name, item in objects.items() if item is shape.side)
        part = _part(self.scene, self.plateau, name, "ROADSIDEPART", "REGION", "street side")
        self.scene.add_parameters(part, shape.side)
        return name, part

    def _street_pieces(
        self, index: int, strip: SurfaceStrip, streets: list[tuple[StreetShape, tuple[str, Entity]]]
    ) -> Iterator[_Piece]:
        """Yield the pieces of one strip, each over the stations of a street side; a kerb's face belongs to its kerb."""
        for shape, (name, part) in streets if strip.kind != "kerb_face" else ():
            start, end = (min(max(s, 0.0), self.scene.geometry.length) for s in (
                shape.side.start_station, shape.side.end_station
            ))  # fmt: skip
            if end > start and self._wide(index, self.scene.rows(start, end)):
                own_strip = replace(strip, material=shape.materials[strip.kind])
                instance, piece_name = shape.side.instance, f"{name}/{strip.kind.replace('_', '-')}"
                yield _Piece(piece_name, index, strip.kind, own_strip, part, instance, start, end, None)

    def _turnout_pieces(self, index: int, strip: SurfaceStrip, wholes: dict[int, Entity]) -> Iterator[_Piece]:
        """Yield the pieces of one strip, each over the stations of a turnout in which the strip has any width."""
        for shape in self.section.turnouts:
            instance = shape.turnout.instance
            start_station, end_station = _range(shape, self.scene.geometry.length)
            if end_station > start_station and self._wide(index, self.scene.rows(start_station, end_station)):
                name = f"{self.turnouts[instance]}/{strip.kind}"
                yield _Piece(
                    name, index, strip.kind, strip, wholes[instance], instance, start_station, end_station, None
                )

    def _wide(self, index: int, station: Float) -> bool:
        """Return whether a strip is wider than `_NARROWEST` at any of the stations (R,)."""
        distances = self.section.distances(station)
        return bool((distances[:, index + 1] - distances[:, index] > _NARROWEST).any())

    def _write_piece(self, piece: _Piece) -> None:
        """Add the road part and the surface of a strip, unless it has no width anywhere."""
        station = self.scene.rows(piece.start, piece.end)
        if not self._wide(piece.index, station):
            return
        ifc, is_paved = self.ifc, piece.strip.class_name == "road"
        kind = _PART_TYPES.get(piece.kind, "USERDEFINED")
        part = _part(self.scene, piece.whole, piece.name, kind, object_type=piece.kind)
        pieces = [replace(piece, index=piece.index - 1), piece] if piece.kind == "kerb" else [piece]
        items = [ifc.mesh(*mesh, False) for item in pieces for mesh in self._meshes(item, station)]
        entity, kind = ("IfcCourse", "PAVEMENT") if is_paved else ("IfcEarthworksFill", "USERDEFINED")
        entity, kind = _STREET_ENTITIES.get(piece.kind, (entity, kind))
        shape = ifc.shape(items, "Tessellation")
        surface = ifc.add_product(entity, piece.name, kind, piece.kind, Representation=shape)
        if is_paved:
            ifc.note_relation("IfcRelAggregates", self.pavement, [surface])
            ifc.note_relation("IfcRelReferencedInSpatialStructure", part, [surface])
        else:
            ifc.note_relation("IfcRelContainedInSpatialStructure", part, [surface])
        ifc.assign_material(surface, piece.strip.material)
        self._describe(part, surface, piece, station)

    def _describe(self, part: Entity, surface: Entity, piece: _Piece, station: Float) -> None:
        """Add property sets to a strip's part and surface: class, stations, width, nominal measures."""
        ifc = self.ifc
        distances = self.section.distances(station)
        widths = distances[:, piece.index + 1] - distances[:, piece.index]
        values = {
            "instance": ifc.value(piece.instance),
            "class": ifc.value(piece.strip.class_name),
            "kind": ifc.value(piece.kind),
            "start_station": ifc.value(piece.start, "m"),
            "end_station": ifc.value(piece.end, "m"),
        }
        if piece.width is not None:
            values["width"] = ifc.value(piece.width, "m")
        for entity in (part, surface):
            ifc.add_properties(entity, "SynthRoads", values)
        if piece.strip.class_name == "road":
            nominal = {
                "NominalLength": ifc.add("IfcNonNegativeLengthMeasure", rounded(piece.end - piece.start)),
                "NominalWidth": ifc.add("IfcNonNegativeLengthMeasure", rounded(widths.max())),
            }
            ifc.add_properties(surface, "Pset_CourseCommon", nominal)

    def _meshes(self, piece: _Piece, station: Float) -> Iterator[tuple[Float, NDArray[np.intp]]]:
        """Yield vertices (N, 3) and triangles (M, 3) of a strip's blocks, finer across where it is damaged.

        The verge has a block before and behind every side road; there is nothing in the steps of joined ramps.
        """
        side = self.carriageway.side
        openings = sorted(self.scene.geometry.openings(side)) if piece.kind == "verge" else []
        if piece.kind == "verge" or piece.kind in TURNOUT_STRIPS:
            openings = sorted([*openings, *self.scene.geometry.joined_steps(side)])
        if openings:
            begin = piece.start
            for start, end in [*openings, (piece.end, piece.end)]:
                rows = station[(station >= begin) & (station <= start)]
                if len(rows) > 1:
                    yield self._mesh(piece.index, rows, np.array([0.0, 1.0]), self._undamaged_section)
                begin = end
            return
        for first_row, last_row, damages in self._blocks(piece, station):
            shares, section = np.array([0.0, 1.0]), self.section
            if damages:
                section = _with_damages(section, damages)
                shares = damage_columns(section, piece.index, self.scene.tolerance)
            elif piece.index in self._damaged_strips:
                section = self._undamaged_section
            yield self._mesh(piece.index, station[first_row : last_row + 1], shares, section)

    def _mesh(
        self, index: int, station: Float, shares: Float, section: CarriagewaySection
    ) -> tuple[Float, NDArray[np.intp]]:
        """Return points (N, 3) and triangles (M, 3) of a strip at shares (K,) of its width, lowered by damage."""
        geometry = self.scene.geometry
        inner, outer = section.distances(station)[:, index : index + 2].T
        crossfall = geometry.crossfall(self.carriageway, station)
        inner_height, outer_height = section.elevations(station, crossfall)[:, index : index + 2].T
        is_wide = outer - inner > _POINTED
        outer, outer_height = np.where(is_wide, outer, inner), np.where(is_wide, outer_height, inner_height)
        distances = inner[:, None] + (outer - inner)[:, None] * shares
        heights = (
            geometry.profile.elevation(station)[:, None]
            + inner_height[:, None]
            + (outer_height - inner_height)[:, None] * shares
        )
        stations, offset = np.repeat(station, len(shares)), self.carriageway.sign * distances.ravel()
        z = heights.ravel() - damage_depth(section, stations, offset)
        points = np.column_stack([geometry.alignment.place(stations, offset), z])
        # On the left carriageway a row runs from right to left, on the right one from left to right.
        return points, grid_triangles(len(station), len(shares), flipped=self.carriageway.sign < 0)

    def _blocks(self, piece: _Piece, station: Float) -> Iterator[tuple[int, int, list[SurfaceShape]]]:
        """Yield (first row, last row, what shapes it) of each stretch along which the same damage lies."""
        damages = self._damages if piece.index in self._damaged_strips else []
        ranges = np.array([_damage_range(damage) for damage in damages]).reshape(-1, 2)
        # Cell i lies between rows i and i + 1. A damage lies in the cells from the first that ends behind the damage's
        # start to the last that begins before the damage's end.
        first_cells = np.searchsorted(station[1:], ranges[:, 0], "right").tolist()
        end_cells = np.searchsorted(station[:-1], ranges[:, 1], "left").tolist()
        starts, ends = defaultdict(list), defaultdict(list)
        for number, (first_cell, end_cell) in enumerate(zip(first_cells, end_cells, strict=True)):
            if first_cell < end_cell:
                starts[first_cell].append(number)
                ends[end_cell].append(number)
        active: set[int] = set()
        for first_row, last_row in pairwise(sorted({0, len(station) - 1, *starts, *ends})):
            active = (active - set(ends[first_row])) | set(starts[first_row])
            yield first_row, last_row, [damages[number] for number in sorted(active)]

    def _write_damage(self) -> None:
        """Add a DEFECT for each damage; only patches and cracks get shapes: ruts and potholes are in the courses."""
        ifc, pavement = self.ifc, self.carriageway.pavement
        damages: list[tuple[str, Rut | Pothole, float, float]] = [
            ("rut", rut, rut.start_station, self._rut_offset(rut)) for rut in pavement.ruts
        ]
        damages += [("pothole", hole, hole.station, hole.offset) for hole in pavement.potholes]
        for number, (kind, damage, station, offset) in enumerate(damages):
            name, instance = self.scene.geometry.numbers.part(self.name, number)
            placement = self.scene.place(station, offset).placement
            defect = ifc.add_product("IfcSurfaceFeature", name, "DEFECT", kind, placement)
            ifc.add_labels(defect, instance, self.carriageway.points_class, damage)
            ifc.note_relation("IfcRelAdheresToElement", self.pavement, [defect])
        surface_damages: list[Patch | Crack | RemovedMarking] = [
            *pavement.patches,
            *pavement.cracks,
            *pavement.removed_markings,
        ]
        films = MarkingFilms(self.scene.geometry, self.carriageway.side)
        for number, item in enumerate(surface_damages, len(damages)):
            name, instance = self.scene.geometry.numbers.part(self.name, number)
            faces = damaged_surface(self.scene.geometry, item, self.carriageway.side, self.scene.stations, films)
            mesh = _triangles(faces)
            shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation") if mesh else None
            kind = _damage_kind(item)
            defect = ifc.add_product("IfcSurfaceFeature", name, "DEFECT", kind, Representation=shape)
            ifc.add_labels(defect, instance, self.carriageway.points_class)
            ifc.note_relation("IfcRelAdheresToElement", self.pavement, [defect])

    def _write_joints(self) -> None:
        """Add the pavement's joints, those along the road as one feature and those across it as another."""
        ifc, pavement, scene = self.ifc, self.carriageway.pavement, self.scene
        joints = list(joints_of(self.section, scene.stations))
        for kind in ("longitudinal", "transverse"):
            faces = [joint_surface(scene.geometry, joint, scene.stations) for joint in joints if joint.kind == kind]
            mesh = _triangles(join_faces(faces))
            if not mesh:
                continue
            name, shape = f"{self.name}/{kind}-joints", ifc.shape([ifc.mesh(*mesh, False)], "Tessellation")
            feature = ifc.add_product("IfcSurfaceFeature", name, "USERDEFINED", f"{kind} joint", Representation=shape)
            values = {"class": ifc.value(self.carriageway.points_class)}
            values |= {
                "width": ifc.value(joint_width(self.section), "m"),
                "depth": ifc.value(pavement.joint_depth, "m"),
            }
            ifc.add_properties(feature, "SynthRoads", values | {"sealed": ifc.value(pavement.is_concrete)})
            ifc.note_relation("IfcRelAdheresToElement", self.pavement, [feature])

    def _rut_offset(self, rut: Rut) -> float:
        """Return the offset of the middle of a rut's lane at the rut's start, m."""
        lane = min(rut.lane, len(self.carriageway.lanes) - 1)
        boundaries = self.section.lane_boundaries(rut.start_station)[0]
        return self.carriageway.sign * float(boundaries[lane] + boundaries[lane + 1]) / 2.0


def _damage_kind(item: Patch | Crack | RemovedMarking) -> str:
    """Return the words for a damage's object type in IFC, such as ``transverse crack``."""
    if isinstance(item, Crack):
        return f"{item.kind} crack"
    return "patch" if isinstance(item, Patch) else "removed marking"


def _range(shape: TurnoutShape, length: float) -> tuple[float, float]:
    """Return the stations (m) between which a turnout changes the cross-section, clipped to the road."""
    start_station, end_station = shape.range()
    return max(start_station, 0.0), min(end_station, length)


def _damage_range(damage: SurfaceShape) -> tuple[float, float]:
    """Return the start and end stations (m) of what shapes a pavement's surface."""
    if isinstance(damage, Rut | Overlay):
        return damage.start_station, damage.end_station
    return damage.station - damage.length / 2.0, damage.station + damage.length / 2.0


def _with_damages(section: CarriagewaySection, damages: Sequence[SurfaceShape]) -> CarriagewaySection:
    """Return a copy of a section with other forms of its surface, on which its strips don't depend."""
    kinds = {"ruts": Rut, "potholes": Pothole, "settlements": Settlement, "overlays": Overlay}
    update = {name: tuple(item for item in damages if isinstance(item, kind)) for name, kind in kinds.items()}
    return section.with_pavement(section.carriageway.pavement.model_copy(update=update))


def _write_side_road(
    scene: Scene, name: str, side_road: RoadObject, faces: dict[str, Faces], kinds: tuple[str, str, Pavement]
) -> None:
    """Add a side road: a road part with its pavement of one course, its verge, and its markings as one feature.

    Args:
        scene: that it belongs to.
        name: its id.
        side_road: what the set says of it; a crossing road or a ramp too.
        faces: its polygons: ``pavement``, ``verge`` and ``paint``.
        kinds: type of its road part, what it is in words, and its pavement.
    """
    ifc, (predefined_part, word, course) = scene.ifc, kinds
    part = _part(scene, scene.road, name, predefined_part, "REGION", word)
    scene.add_parameters(part, side_road)
    kind = "RIGID" if course.is_concrete else "FLEXIBLE"
    pavement = ifc.add_product("IfcPavement", name, kind, Name=f"{name}/pavement")
    ifc.note_relation("IfcRelContainedInSpatialStructure", part, [pavement])
    ifc.add_labels(pavement, side_road.instance, side_road.points_class)
    surfaces = (
        ("pavement", "IfcCourse", "PAVEMENT", course.kind, side_road.points_class),
        ("verge", "IfcEarthworksFill", "USERDEFINED", "verge", "roadside"),
    )
    for strip, entity, predefined, material, class_name in surfaces:
        mesh = _triangles(faces[strip])
        assert mesh
        shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation")
        surface = ifc.add_product(entity, f"{name}/{strip}", predefined, f"{word} {strip}", Representation=shape)
        if strip == "pavement":
            ifc.note_relation("IfcRelAggregates", pavement, [surface])
        else:
            ifc.note_relation("IfcRelContainedInSpatialStructure", part, [surface])
        ifc.assign_material(surface, material)
        ifc.add_labels(surface, side_road.instance, class_name)
    mesh = _triangles(faces["paint"])
    if mesh:
        shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation")
        lines = ifc.add_product(
            "IfcSurfaceFeature", f"{name}/markings", "LINEMARKING", f"{word} markings", Representation=shape
        )
        ifc.note_relation("IfcRelAdheresToElement", pavement, [lines])
        ifc.assign_material(lines, "paint_white")
        ifc.add_labels(lines, side_road.instance, "road_marking")


def _write_median(scene: Scene) -> None:
    """Add the median's road part, and its surface if the road has two carriageways."""
    geometry = scene.geometry
    index = next((i for i, strip in enumerate(geometry.strips) if strip.kind == "median"), None)
    median = next(iter(geometry.parameters.of_type(Median).items()), None)
    if index is None and median is None:
        return
    name = median[0] if median else "road/median"
    part = _part(scene, scene.road, name, "CENTRALRESERVE")
    scene.parts["median"] = part
    if index is not None:
        _write_median_surface(scene, index, name, part)
    if median:
        scene.add_parameters(part, median[1])


def _write_median_surface(scene: Scene, index: int, name: str, part: Entity) -> None:
    """Add the median strip's surface as an IfcEarthworksFill contained in its road part."""
    ifc, geometry = scene.ifc, scene.geometry
    strip = geometry.strips[index]
    station = scene.stations
    sides, heights = (values[:, index : index + 2][:, ::-1] for values in geometry.boundaries(station))
    plan = geometry.alignment.place(np.repeat(station, 2), sides.ravel())
    points = np.column_stack([plan, heights.ravel()])
    shape = ifc.shape([ifc.mesh(points, grid_triangles(len(station), 2), False)], "Tessellation")
    surface = {"Name": f"{name}/surface", "Representation": shape}
    fill = ifc.add_product("IfcEarthworksFill", name, "USERDEFINED", "median", **surface)
    ifc.note_relation("IfcRelContainedInSpatialStructure", part, [fill])
    ifc.assign_material(fill, strip.material)
    ifc.add_labels(fill, strip.instance, strip.class_name)


# --- markings -------------------------------------------------------------------------------------------------------

_MARKINGS: dict[type, str] = {LineMarking: "LINEMARKING", Hatching: "HATCHMARKING", Arrow: "SYMBOLMARKING"}
"""Class of a marking -> its predefined type."""


def write_markings(scene: Scene, progress: Progress) -> None:
    """Add every line, hatching and arrow as an IfcSurfaceFeature that adheres to its carriageway's pavement."""
    objects = scene.geometry.parameters.objects
    for number, (name, item) in enumerate(objects.items()):
        if isinstance(item, LineMarking | Hatching | Arrow):
            progress(STAGE, number / len(objects))
            if isinstance(item, LineMarking):
                _, faces, _ = dash_surfaces(scene.geometry, item, scene.stations)
            else:
                faces = painted_surface(scene.geometry, item, scene.stations)
            side = scene.geometry.parameters.carriageway_of(item).side
            _write_marking(scene, name, item, faces, scene.parts[f"pavement-{side}"])


def _write_marking(scene: Scene, name: str, item: LineMarking | Hatching | Arrow, faces: Faces, bearer: Entity) -> None:
    """Add a marking's polygons as an IfcSurfaceFeature that adheres to its bearer, the carriageway's pavement."""
    ifc = scene.ifc
    mesh = _triangles(faces)
    shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation") if mesh else None
    object_type = "hatching" if isinstance(item, Hatching) else item.kind
    feature = ifc.add_product("IfcSurfaceFeature", name, _MARKINGS[type(item)], object_type, Representation=shape)
    ifc.note_relation("IfcRelAdheresToElement", bearer, [feature])
    ifc.assign_material(feature, f"paint_{item.color}")
    scene.add_parameters(feature, item)
    common = {
        "MaterialColour": ifc.add("IfcLabel", item.color),
        "MaterialThickness": ifc.add("IfcPositiveLengthMeasure", item.film_thickness),
    }
    ifc.add_properties(feature, "Pset_RoadMarkingCommon", common)


def _triangles(faces: Faces) -> tuple[Float, NDArray[np.intp]] | None:
    """Return convex polygons as points and fans of triangles (M, 3); None if there are no polygons."""
    if not len(faces):
        return None
    starts = np.cumsum(faces.sizes) - faces.sizes
    counts = faces.sizes - 2
    fan_corners = np.repeat(starts, counts)
    number_in_fan = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    fans = np.column_stack([fan_corners, fan_corners + number_in_fan + 1, fan_corners + number_in_fan + 2])
    return faces.points, faces.corners[fans]
