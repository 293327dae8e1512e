"""The road in IFC 4.3: its lateral parts, what they are paved with, and the markings on it.

Spatially an IfcRoad has a ROADWAYPLATEAU per direction (CARRIAGEWAY with its TRAFFICLANEs, HARDSHOULDER, SOFTSHOULDER,
turnouts), a CENTRALRESERVE, and a ROADSIDE on either side. Physically each direction has one IfcPavement, an aggregate
of one IfcCourse per strip, which its part refers to; verge and median are IfcEarthworksFills. Markings are
IfcSurfaceFeatures that adhere to their carriageway's pavement, not contained in any part.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...road.damage import damage_columns, damage_depth, damaged_strips
from ...road.geometry import SurfaceStrip
from ...road.guidelines import LIMITS
from ...road.objects import AnyWidth
from ...road.parameters import RoadParameters
from ...road.section import Arrow, Carriageway, Crack, Hatching, LineMarking, Median, Patch, Pothole, Rut, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.turnout_geometry import TURNOUT_STRIPS, TurnoutShape
from ..faces import Faces
from ..surfaces import damaged_surface, dash_surfaces, painted_surface
from .entities import Entity, Float, IfcFile, short
from .scene import Scene, grid_triangles

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
}
"""Kind of strip -> type of its road part; the others, edge strips, have none in IFC."""
_TURNOUT_TYPES = {"emergency_bay": "LAYBY", "exit": "ROADSEGMENT", "entry": "ROADSEGMENT"}
_PAVEMENTS = {"asphalt": "FLEXIBLE", "concrete": "RIGID"}


def write_road(ifc: IfcFile, parameters: RoadParameters, site: Entity) -> Entity:
    """Add the IfcRoad with what is designed for all of it."""
    name = parameters.metadata.identifier
    road = ifc.rooted(
        "IfcRoad", "road", Name=name, LongName=parameters.metadata.title or None, ObjectPlacement=ifc.local_frame,
        CompositionType="ELEMENT",
    )  # fmt: skip
    ifc.gather("IfcRelAggregates", site, [road])
    lanes = [len(carriageway.lanes) for carriageway in parameters.of_type(Carriageway).values()]
    design = {
        "DesignSpeed": ifc.add("IfcLinearVelocityMeasure", short(LIMITS[parameters.design_class].speed / 3.6)),
        "NumberOfThroughLanes": ifc.add("IfcCountMeasure", sum(lanes)),
        "RoadDesignClass": ifc.add("IfcLabel", parameters.design_class),
    }
    ifc.properties(road, "Pset_RoadDesignCriteriaCommon", design)
    return road


def write_carriageways(scene: Scene) -> None:
    """Add all parts of the road and their surfaces."""
    for side in _SIDES:
        # With a slash, as no object's id has one.
        scene.parts[f"roadside-{side}"] = _part(scene, scene.road, f"road/roadside-{side}", "ROADSIDE")
    for name, carriageway in scene.geometry.parameters.of_type(Carriageway).items():
        _Direction(scene, name, carriageway).write()
    _write_median(scene)


def _part(
    scene: Scene, whole: Entity, name: str, kind: str, usage: str = "LATERAL", about: str | None = None
) -> Entity:
    """Add a part of the road, or of one of its parts."""
    part = scene.ifc.product("IfcRoadPart", name, kind, about, CompositionType="PARTIAL", UsageType=usage)
    scene.ifc.gather("IfcRelAggregates", whole, [part])
    return part


@dataclass(frozen=True)
class _Piece:
    """A strip, or a turnout's piece of one.

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


class _Direction:
    """Writes one carriageway."""

    def __init__(self, scene: Scene, name: str, carriageway: Carriageway) -> None:
        self.scene, self.ifc, self.name, self.carriageway = scene, scene.ifc, name, carriageway
        self.section = scene.geometry.sections[carriageway.side]
        self._damaged_strips = set(damaged_strips(self.section))
        self.turnouts = {
            shape.turnout.instance: key
            for shape in self.section.turnouts
            for key, item in scene.geometry.parameters.objects.items()
            if item is shape.turnout
        }

    def write(self) -> None:
        """Add parts, pavement and courses."""
        scene, carriageway = self.scene, self.carriageway
        self.plateau = _part(scene, scene.road, f"{self.name}/plateau", "ROADWAYPLATEAU")
        self.part = _part(scene, self.plateau, self.name, "CARRIAGEWAY")
        scene.parts[f"carriageway-{carriageway.side}"] = self.part
        scene.describe(self.part, carriageway)
        pieces = list(self._pieces())
        kind = _PAVEMENTS[carriageway.pavement.kind]
        self.pavement = self.ifc.product("IfcPavement", self.name, kind, Name=f"{self.name}/pavement")
        self.ifc.gather("IfcRelContainedInSpatialStructure", self.part, [self.pavement])
        self.ifc.label(self.pavement, carriageway.instance, carriageway.points_class, carriageway.pavement)
        scene.parts[f"pavement-{carriageway.side}"] = self.pavement
        for piece in pieces:
            self._write_piece(piece)
        self._write_damage()

    def _pieces(self) -> Iterator[_Piece]:
        strips = [strip for strip in self.scene.geometry.strips if strip.side == self.carriageway.side]
        if self.carriageway.side == "left":
            strips = strips[::-1]
        length, lanes, lane = self.scene.geometry.length, len(self.carriageway.lanes), 0
        wholes = {instance: self._turnout(key) for instance, key in self.turnouts.items()}
        for index, strip in enumerate(strips):
            kind = strip.kind
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
        """Add the part of a turnout."""
        turnout = self.scene.geometry.parameters.objects[name]
        assert isinstance(turnout, Turnout)
        part = _part(self.scene, self.plateau, name, _TURNOUT_TYPES[turnout.kind], "REGION", turnout.kind)
        self.scene.describe(part, turnout)
        return part

    def _turnout_pieces(self, index: int, strip: SurfaceStrip, wholes: dict[int, Entity]) -> Iterator[_Piece]:
        for shape in self.section.turnouts:
            instance = shape.turnout.instance
            low, high = _range(shape, self.scene.geometry.length)
            if high > low and self._wide(index, self.scene.rows(low, high)):
                name = f"{self.turnouts[instance]}/{strip.kind}"
                yield _Piece(name, index, strip.kind, strip, wholes[instance], instance, low, high, None)

    def _wide(self, index: int, station: Float) -> bool:
        distances = self.section.distances(station)
        return bool((distances[:, index + 1] - distances[:, index] > _NARROWEST).any())

    def _write_piece(self, piece: _Piece) -> None:
        """Add the part of a strip and its surface, if it is anywhere on the road."""
        station = self.scene.rows(piece.start, piece.end)
        if not self._wide(piece.index, station):
            return
        ifc, paved = self.ifc, piece.strip.class_name == "road"
        kind = _PART_TYPES.get(piece.kind, "USERDEFINED")
        part = _part(self.scene, piece.whole, piece.name, kind, about=piece.kind)
        items = [ifc.mesh(*mesh, False) for mesh in self._meshes(piece, station)]
        entity, kind = ("IfcCourse", "PAVEMENT") if paved else ("IfcEarthworksFill", "USERDEFINED")
        shape = ifc.shape(items, "Tessellation")
        surface = ifc.product(entity, piece.name, kind, piece.kind, Representation=shape)
        if paved:
            ifc.gather("IfcRelAggregates", self.pavement, [surface])
            ifc.gather("IfcRelReferencedInSpatialStructure", part, [surface])
        else:
            ifc.gather("IfcRelContainedInSpatialStructure", part, [surface])
        ifc.made_of(surface, piece.strip.material)
        self._describe(part, surface, piece, station)

    def _describe(self, part: Entity, surface: Entity, piece: _Piece, station: Float) -> None:
        """Say how wide and long a strip is."""
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
            ifc.properties(entity, "SynthRoads", values)
        if piece.strip.class_name == "road":
            nominal = {
                "NominalLength": ifc.add("IfcNonNegativeLengthMeasure", short(piece.end - piece.start)),
                "NominalWidth": ifc.add("IfcNonNegativeLengthMeasure", short(widths.max())),
            }
            ifc.properties(surface, "Pset_CourseCommon", nominal)

    def _meshes(self, piece: _Piece, station: Float) -> Iterator[tuple[Float, NDArray[np.intp]]]:
        """Yield vertices and triangles of a strip, finer across where it is damaged."""
        for first, last, damaged in self._blocks(piece, station):
            section, rows = self.section, station[first : last + 1]
            shares = np.array([0.0, 1.0])
            if damaged:
                section = _local_damage(section, rows[0], rows[-1])
                shares = damage_columns(section, piece.index, self.scene.tolerance)
            yield self._mesh(piece.index, rows, shares)

    def _mesh(self, index: int, station: Float, shares: Float) -> tuple[Float, NDArray[np.intp]]:
        """Return the points and triangles of a strip between its boundaries, at shares (K,) of its width."""
        geometry, section = self.scene.geometry, self.section
        inner, outer = section.distances(station)[:, index : index + 2].T
        crossfall = geometry.crossfall(self.carriageway, station)
        low, high = section.elevations(station, crossfall)[:, index : index + 2].T
        there = outer - inner > _POINTED
        outer, high = np.where(there, outer, inner), np.where(there, high, low)
        distance = inner[:, None] + (outer - inner)[:, None] * shares
        height = geometry.profile.elevation(station)[:, None] + low[:, None] + (high - low)[:, None] * shares
        every, offset = np.repeat(station, len(shares)), self.carriageway.sign * distance.ravel()
        z = height.ravel() - damage_depth(section, every, offset)
        points = np.column_stack([geometry.alignment.place(every, offset), z])
        # On the left carriageway a row runs from right to left, on the right one from left to right.
        return points, grid_triangles(len(station), len(shares), flip=self.carriageway.sign < 0)

    def _blocks(self, piece: _Piece, station: Float) -> Iterator[tuple[int, int, bool]]:
        """Yield the first and last row of every stretch along which the same damage lies, and whether there is any."""
        ranges = _damage_ranges(self.section) if piece.index in self._damaged_strips else []
        masks = [(station[1:] > low) & (station[:-1] < high) for low, high in ranges]
        damage = np.array([np.zeros(len(station) - 1, dtype=bool), *masks])
        borders = [0, *(np.flatnonzero(np.diff(damage, axis=1).any(axis=0)) + 1).tolist(), len(station) - 1]
        for first, last in pairwise(borders):
            yield first, last, bool(damage[:, first].any())

    def _write_damage(self) -> None:
        """Add a DEFECT for all damage; the shapes of ruts and potholes are in the courses' surfaces."""
        ifc, pavement = self.ifc, self.carriageway.pavement
        damages: list[tuple[str, Rut | Pothole, float, float]] = [
            ("rut", rut, rut.start_station, self._rut_offset(rut)) for rut in pavement.ruts
        ]
        damages += [("pothole", hole, hole.station, hole.offset) for hole in pavement.potholes]
        for number, (kind, damage, station, offset) in enumerate(damages):
            name, instance = self.scene.geometry.numbers.part(self.name, number)
            placement = self.scene.place(station, offset).placement
            defect = ifc.product("IfcSurfaceFeature", name, "DEFECT", kind, placement)
            ifc.label(defect, instance, self.carriageway.points_class, damage)
            ifc.gather("IfcRelAdheresToElement", self.pavement, [defect])
        laid: list[Patch | Crack] = [*pavement.patches, *pavement.cracks]
        for number, item in enumerate(laid, len(damages)):
            name, instance = self.scene.geometry.numbers.part(self.name, number)
            mesh = _triangles(damaged_surface(self.scene.geometry, item, self.scene.stations))
            shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation") if mesh else None
            kind = "patch" if isinstance(item, Patch) else f"{item.kind} crack"
            defect = ifc.product("IfcSurfaceFeature", name, "DEFECT", kind, Representation=shape)
            ifc.label(defect, instance, self.carriageway.points_class)
            ifc.gather("IfcRelAdheresToElement", self.pavement, [defect])

    def _rut_offset(self, rut: Rut) -> float:
        """Return the offset of the middle of a rut's lane at its beginning."""
        lane = min(rut.lane, len(self.carriageway.lanes) - 1)
        boundaries = self.section.lane_boundaries(rut.start_station)[0]
        return self.carriageway.sign * float(boundaries[lane] + boundaries[lane + 1]) / 2.0


def _range(shape: TurnoutShape, length: float) -> tuple[float, float]:
    """Return the stations (m) between which a turnout changes anything, within the road."""
    low, high = shape.range()
    return max(low, 0.0), min(high, length)


def _damage_ranges(section: CarriagewaySection) -> list[tuple[float, float]]:
    """Return the stations (m) of every rut and pothole."""
    pavement = section.carriageway.pavement
    holes = [(hole.station - hole.length / 2.0, hole.station + hole.length / 2.0) for hole in pavement.potholes]
    return holes + [(rut.start_station, rut.end_station) for rut in pavement.ruts]


def _local_damage(section: CarriagewaySection, low: float, high: float) -> CarriagewaySection:
    """Return a section with no damage but that between two stations (m)."""
    carriageway, pavement = section.carriageway, section.carriageway.pavement
    ruts = tuple(rut for rut in pavement.ruts if rut.start_station < high and rut.end_station > low)
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    holes = tuple(h for h in pavement.potholes if abs(h.station - middle) < half + h.length / 2.0)
    local = pavement.model_copy(update={"ruts": ruts, "potholes": holes})
    turnouts = [shape.turnout for shape in section.turnouts]
    return CarriagewaySection(carriageway.model_copy(update={"pavement": local}), turnouts)


def _write_median(scene: Scene) -> None:
    """Add the strip between the carriageways; beside a single one a median is named, and has no surface."""
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
        scene.describe(part, median[1])


def _write_median_surface(scene: Scene, index: int, name: str, part: Entity) -> None:
    """Add the surface of a strip to the part of the road that it is."""
    ifc, geometry = scene.ifc, scene.geometry
    strip = geometry.strips[index]
    station = scene.stations
    sides = geometry.offsets(station)[:, index : index + 2][:, ::-1]
    heights = geometry.boundary_elevations(station)[:, index : index + 2][:, ::-1]
    plan = geometry.alignment.place(np.repeat(station, 2), sides.ravel())
    points = np.column_stack([plan, heights.ravel()])
    shape = ifc.shape([ifc.mesh(points, grid_triangles(len(station), 2), False)], "Tessellation")
    surface = {"Name": f"{name}/surface", "Representation": shape}
    fill = ifc.product("IfcEarthworksFill", name, "USERDEFINED", "median", **surface)
    ifc.gather("IfcRelContainedInSpatialStructure", part, [fill])
    ifc.made_of(fill, strip.material)
    ifc.label(fill, strip.instance, strip.class_name)


# --- markings -------------------------------------------------------------------------------------------------------

_MARKINGS: dict[type, str] = {LineMarking: "LINEMARKING", Hatching: "HATCHMARKING", Arrow: "SYMBOLMARKING"}
"""Class of a marking -> its predefined type."""


def write_markings(scene: Scene) -> None:
    """Add every line, hatching and arrow with the surface of its film."""
    for name, item in scene.geometry.parameters.objects.items():
        if isinstance(item, LineMarking | Hatching | Arrow):
            if isinstance(item, LineMarking):
                _, faces, _ = dash_surfaces(scene.geometry, item, scene.stations)
            else:
                faces = painted_surface(scene.geometry, item, scene.stations)
            side = scene.geometry.parameters.carriageway_of(item).side
            _write_marking(scene, name, item, faces, scene.parts[f"pavement-{side}"])


def _write_marking(scene: Scene, name: str, item: LineMarking | Hatching | Arrow, faces: Faces, bearer: Entity) -> None:
    ifc = scene.ifc
    mesh = _triangles(faces)
    shape = ifc.shape([ifc.mesh(*mesh, False)], "Tessellation") if mesh else None
    about = "hatching" if isinstance(item, Hatching) else item.kind
    feature = ifc.product("IfcSurfaceFeature", name, _MARKINGS[type(item)], about, Representation=shape)
    ifc.gather("IfcRelAdheresToElement", bearer, [feature])
    ifc.made_of(feature, f"paint_{item.color}")
    scene.describe(feature, item)
    common = {
        "MaterialColour": ifc.add("IfcLabel", item.color),
        "MaterialThickness": ifc.add("IfcPositiveLengthMeasure", item.film_thickness),
    }
    ifc.properties(feature, "Pset_RoadMarkingCommon", common)


def _triangles(faces: Faces) -> tuple[Float, NDArray[np.intp]] | None:
    """Return convex polygons as points and triangles."""
    if not len(faces):
        return None
    starts = np.cumsum(faces.sizes) - faces.sizes
    counts = faces.sizes - 2
    first = np.repeat(starts, counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    fans = np.column_stack([first, first + number + 1, first + number + 2])
    return faces.points, faces.corners[fans]
