"""Stumbling blocks for readers of IFC: placements along a line, deprecated entities, segments that don't quite meet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell
import numpy as np
import pytest

from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.twin.ifc.writer import write_ifc
from tests.helpers.files.alignment_segments import gaps
from tests.helpers.files.ifc_reading import placement, written
from tests.helpers.roads.checker_full_road import full
from tests.helpers.roads.sampled_parts import scenario
from tests.helpers.roads.twin_roads import full_road
from tests.judges.ifc import issues

MICROMETRE = 1e-6
DEPRECATED = {
    *("IfcBuildingSystem", "IfcCivilElement", "IfcCivilElementType", "IfcElectricDistributionBoard"),
    *("IfcElectricDistributionBoardType", "IfcFaceBasedSurfaceModel", "IfcMaterialList", "IfcPostalAddress"),
    *("IfcMaterialClassificationRelationship", "IfcPermeableCoveringProperties", "IfcRelConnectsPortToElement"),
    *("IfcRelServicesBuildings", "IfcTelecomAddress", "IfcTextLiteral", "IfcTrapeziumProfileDef", "IfcProxy"),
    *("IfcRelCoversBldgElements", "IfcRelCoversSpaces", "IfcPresentationStyleAssignment", "IfcNullStyle"),
}
"""Entities of IFC4X3_ADD2 that the standard says not to use any more, as buildingSMART's rule IFC102 lists them."""
ABSTRACT_IN_FACT = {
    *("IfcFlowFitting", "IfcFlowSegment", "IfcFlowTerminal", "IfcFlowController", "IfcFlowMovingDevice"),
    *("IfcFlowStorageDevice", "IfcFlowTreatmentDevice", "IfcEnergyConversionDevice"),
}
"""Entities of which only subtypes are to be used."""


@pytest.fixture(scope="module")
def full_file(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A road with every kind of object."""
    return written(RoadParameters.from_dict(full()), tmp_path_factory.mktemp("full"))


def _deprecated(file: Any) -> set[str]:
    return {item.is_a() for item in file} & (DEPRECATED | ABSTRACT_IN_FACT)


def test_no_entity_is_deprecated(full_file) -> None:
    assert _deprecated(full_file) == set()
    boards = full_file.by_type("IfcDistributionBoard")
    assert {board.PredefinedType for board in boards} == {"DISTRIBUTIONBOARD"}


def test_a_deprecated_entity_is_seen() -> None:
    file = ifcopenshell.file(schema="IFC4X3_ADD2")
    file.create_entity("IfcElectricDistributionBoard")
    assert _deprecated(file) == {"IfcElectricDistributionBoard"}


# --- where objects stand --------------------------------------------------------------------------------------------


def _places(file: Any) -> dict[str, np.ndarray]:
    return {item.GlobalId: placement(item) for item in file.by_type("IfcProduct") if item.ObjectPlacement}


def _linear(file: Any) -> set[str]:
    """Return the classes of what is placed along the alignment."""
    products = file.by_type("IfcProduct")
    return {
        item.is_a() for item in products if item.ObjectPlacement and item.ObjectPlacement.is_a("IfcLinearPlacement")
    }


def test_with_local_placement_all_stands_at_the_same_place(full_file, tmp_path: Path) -> None:
    write_ifc(RoadParameters.from_dict(full()), tmp_path / "local.ifc", placement="local")
    local = ifcopenshell.open(str(tmp_path / "local.ifc"))
    assert _linear(local) == {"IfcReferent"}
    assert len(_linear(full_file)) > 10
    theirs, ours = _places(full_file), _places(local)
    assert theirs.keys() == ours.keys()
    assert max(np.abs(theirs[key] - ours[key]).max() for key in theirs) < 2.0 * MICROMETRE


@pytest.mark.slow
def test_local_placement_keeps_the_rules(tmp_path: Path) -> None:
    write_ifc(sample_road(scenario(length=60.0), 4), tmp_path / "local.ifc", placement="local")
    assert issues(ifcopenshell.open(str(tmp_path / "local.ifc"))) == []


# --- segments that meet ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the file of a road with lines, arcs, clothoids, grades and roundings, and no furniture."""
    road = full_road().to_dict()
    kept = ("Alignment", "Carriageway", "Median", "Terrain")
    road["objects"] = {name: item for name, item in road["objects"].items() if item["type"] in kept}
    file = written(RoadParameters.from_dict(road), tmp_path_factory.mktemp("axis"), 0.5)
    return str(file.to_string())


def test_consecutive_segments_meet(full_file, axis: str) -> None:
    found = gaps(full_file), gaps(ifcopenshell.file.from_string(axis))
    assert len(found[1]) == 8
    assert max(gap for one in found for gap in one.values()) < MICROMETRE


@pytest.mark.parametrize(
    ("entity", "attribute", "by", "key"),
    [
        ("IfcAlignmentHorizontalSegment", "SegmentLength", 2e-6, "plan: place"),
        ("IfcAlignmentHorizontalSegment", "StartDirection", 2e-6, "plan: direction"),
        ("IfcAlignmentVerticalSegment", "EndGradient", 2e-6, "profile: direction"),
        ("IfcAlignmentVerticalSegment", "StartHeight", 2e-6, "profile: place"),
        ("IfcClothoid", "ClothoidConstant", 1e-2, "plan curve: direction"),
        ("IfcCircle", "Radius", 0.1, "plan curve: place"),
    ],
)
def test_a_gap_is_seen(axis: str, entity: str, attribute: str, by: float, key: str) -> None:
    file = ifcopenshell.file.from_string(axis)
    item = file.by_type(entity)[0]
    setattr(item, attribute, getattr(item, attribute) + by)
    assert gaps(file)[key] > MICROMETRE
