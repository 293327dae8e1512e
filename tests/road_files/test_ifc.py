"""Alignments of IFC: segments as designed under every name of the schema, and where site and map put them."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, MissingPackageError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.road_files.line import RoadLine, exact_axis
from synthroads_addon.road_files.read import choose_line, read_lines
from tests.helpers.roads.written_lines import Walk, bloss, linear
from tests.road_files.test_opendrive import profile_of

PLAN = [(70.0, 0.0, 0.0, "LINE"), (90.0, 0.0, -1 / 500, "CLOTHOID"), (110.0, -1 / 500, -1 / 500, "CIRCULARARC"),
        (80.0, -1 / 500, 0.0, "BLOSSCURVE")]  # fmt: skip
PROFILE = [(0.0, 100.0, 40.0, 0.02, 0.02, "CONSTANTGRADIENT"), (100.0, 150.0, 42.0, 0.02, -0.01, "PARABOLICARC"),
           (250.0, 100.0, 42.75, -0.01, -0.01, "CONSTANTGRADIENT")]  # fmt: skip
MAP = """#90=IFCPROJECTEDCRS('EPSG:25832',$,$,$,$,$,$);
#91=IFCMAPCONVERSION(#20,#90,500000.,5600000.,120.,{0!r},{1!r},$);
"""


def walk() -> Walk:
    shapes = [(length, (bloss if kind == "BLOSSCURVE" else linear)(length, a, b)) for length, a, b, kind in PLAN]
    return Walk(shapes, 10.0, 20.0, 0.4)


def written(
    path: Path,
    schema: str = "IFC4X3_ADD2",
    unit: float = 1.0,
    rest: str = "",
    site: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Walk:
    """Write one alignment, lengths in a unit (m)."""
    line, rows, ids = walk(), [], []
    for n, (length, a, b, kind) in enumerate(PLAN):
        x, y, heading = line.poses[n]
        radii = ",".join("0." if k == 0.0 else repr(1.0 / k / unit) for k in (a, b))
        rows.append(f"#{200 + 3 * n}=IFCCARTESIANPOINT(({x / unit!r},{y / unit!r}));")
        values = f"#{200 + 3 * n},{heading!r},{radii},{length / unit!r},$,.{kind}."
        rows.append(f"#{201 + 3 * n}=IFCALIGNMENTHORIZONTALSEGMENT($,$,{values});")
        rows.append(f"#{202 + 3 * n}=IFCALIGNMENTSEGMENT('{n:022}',$,$,$,$,$,$,#{201 + 3 * n});")
        ids.append(202 + 3 * n)
    heights = []
    for n, (s, length, z, g, h, kind) in enumerate(PROFILE):
        values = f"{s / unit!r},{length / unit!r},{z / unit!r},{g!r},{h!r},$,.{kind}."
        rows.append(f"#{300 + 2 * n}=IFCALIGNMENTVERTICALSEGMENT($,$,{values});")
        rows.append(f"#{301 + 2 * n}=IFCALIGNMENTSEGMENT('{n + 10:022}',$,$,$,$,$,$,#{300 + 2 * n});")
        heights.append(301 + 2 * n)
    conversion = f"#11=IFCMEASUREWITHUNIT(IFCLENGTHMEASURE({unit!r}),#10);\n"
    conversion += "#12=IFCCONVERSIONBASEDUNIT(#13,.LENGTHUNIT.,'foot',#11);"
    length_unit = "#10" if unit == 1.0 else "#12"
    place = ",".join(repr(value / unit) for value in site)
    plan, profile = (",".join(f"#{n}" for n in each) for each in (ids, heights))
    text = f"""ISO-10303-21;
HEADER;FILE_DESCRIPTION((''),'2;1');FILE_NAME('a','',(''),(''),'','','');FILE_SCHEMA(('{schema}'));ENDSEC;
DATA;
#1=IFCPROJECT('{1:022}',$,'P',$,$,$,$,(#20),#15);
#10=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);
#13=IFCDIMENSIONALEXPONENTS(1,0,0,0,0,0,0);
{conversion}
#14=IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.);
#15=IFCUNITASSIGNMENT(({length_unit},#14));
#16=IFCCARTESIANPOINT((0.,0.,0.));
#17=IFCAXIS2PLACEMENT3D(#16,$,$);
#20=IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,#17,$);
#21=IFCCARTESIANPOINT(({place}));
#22=IFCAXIS2PLACEMENT3D(#21,$,$);
#23=IFCLOCALPLACEMENT($,#22);
#24=IFCSITE('{2:022}',$,'S',$,$,#23,$,$,.ELEMENT.,$,$,$,$,$);
#25=IFCRELAGGREGATES('{3:022}',$,$,$,#1,(#24));
#26=IFCLOCALPLACEMENT(#23,#17);
#30=IFCALIGNMENT('{4:022}',$,'main',$,$,#26,$,$);
#31=IFCALIGNMENTHORIZONTAL('{5:022}',$,$,$,$,#26,$);
#32=IFCALIGNMENTVERTICAL('{6:022}',$,$,$,$,#26,$);
#33=IFCRELNESTS('{7:022}',$,$,$,#30,(#31,#32));
#34=IFCRELNESTS('{8:022}',$,$,$,#31,({plan}));
#35=IFCRELNESTS('{9:022}',$,$,$,#32,({profile}));
{rest}
{chr(10).join(rows)}
ENDSEC;
END-ISO-10303-21;
"""
    path.write_text(text)
    return line


def only(path: Path) -> RoadLine:
    return choose_line(read_lines(path), None, path.name)


@pytest.mark.parametrize("schema", ["IFC4X3_ADD2", "IFC4X3", "IFC4X3_ADD1", "IFC4X3_RC3", "IFC4X3_RC4"])
@pytest.mark.parametrize("unit", [1.0, 0.3048])
def test_segments_are_taken_over_under_every_name_of_the_schema(tmp_path: Path, schema: str, unit: float) -> None:
    line = written(tmp_path / "a.ifc", schema, unit)
    road = only(tmp_path / "a.ifc")
    axis = exact_axis(road)
    assert [piece.kind for piece in road.pieces] == ["line", "clothoid", "circulararc", "bloss"]
    station, points = line.points()
    assert np.hypot(*(axis.alignment.position(station) - points).T).max() < 5e-4
    heights = profile_of(axis).elevation(np.array([0.0, 100.0, 175.0, 350.0]))
    top = 42.0 + 0.02 * 75.0 - 0.5 * 0.03 / 150.0 * 75.0**2
    assert heights.tolist() == pytest.approx([40.0, 42.0, top, 41.75])


@pytest.mark.parametrize("schema", ["IFC4", "IFC2X3", "IFC4X2"])
def test_older_schemas_are_refused(tmp_path: Path, schema: str) -> None:
    written(tmp_path / "a.ifc", schema)
    with pytest.raises(InputError, match=rf"a\.ifc is '{schema}': must be IFC 4\.3"):
        read_lines(tmp_path / "a.ifc")


def test_the_sites_placement_counts(tmp_path: Path) -> None:
    line = written(tmp_path / "a.ifc", site=(3000.0, 4000.0, 50.0))
    axis = exact_axis(only(tmp_path / "a.ifc"))
    assert (axis.alignment.x, axis.alignment.y) == pytest.approx((3010.0, 4020.0))
    assert profile_of(axis).elevation(0.0) == pytest.approx(90.0)
    assert axis.alignment.position(200.0).tolist() == pytest.approx(
        (np.array(line.at(200.0)[:2]) + (3000, 4000)).tolist(), abs=1e-3
    )


def test_the_maps_axis_need_be_no_unit_vector(tmp_path: Path) -> None:
    line = written(tmp_path / "a.ifc", rest=MAP.format(3.0 * math.cos(0.3), 3.0 * math.sin(0.3)))
    road = only(tmp_path / "a.ifc")
    axis = exact_axis(road)
    assert road.system is not None
    assert road.system.epsg == 25832
    x, y, heading = line.poses[0]
    wanted = complex(500000.0, 5600000.0) + complex(x, y) * complex(math.cos(0.3), math.sin(0.3))
    assert complex(axis.alignment.x, axis.alignment.y) == pytest.approx(wanted)
    assert axis.alignment.start_heading == pytest.approx(heading + 0.3)
    assert profile_of(axis).elevation(0.0) == pytest.approx(160.0)


def test_a_system_that_nobody_knows_is_told(tmp_path: Path) -> None:
    written(tmp_path / "a.ifc", rest=MAP.format(1.0, 0.0).replace("EPSG:25832", "site grid"))
    with collected_remarks() as remarks:
        assert only(tmp_path / "a.ifc").system is None
    assert "'site grid' isn't known" in remarks[0]


def test_a_segment_that_isnt_understood_is_named(tmp_path: Path) -> None:
    written(tmp_path / "a.ifc")
    text = (tmp_path / "a.ifc").read_text().replace(".BLOSSCURVE.", ".VIENNESEBEND.")
    (tmp_path / "a.ifc").write_text(text)
    with pytest.raises(InputError, match=r"segment at station 270\.000 m: PredefinedType is 'VIENNESEBEND'"):
        only(tmp_path / "a.ifc")


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ifcopenshell", None)
    written(tmp_path / "a.ifc")
    with pytest.raises(MissingPackageError, match=r"needs the package ifcopenshell: pip install 'synthroads\[twin\]'"):
        read_lines(tmp_path / "a.ifc")


@pytest.mark.parametrize("cut", [300, 900, 2500])
def test_a_file_that_ends_too_early_is_one_line(tmp_path: Path, cut: int) -> None:
    written(tmp_path / "a.ifc")
    (tmp_path / "a.ifc").write_text((tmp_path / "a.ifc").read_text()[:cut])
    with pytest.raises(InputError):
        only(tmp_path / "a.ifc")


def test_a_broken_header_never_reaches_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It could end the process."""
    ifcopenshell = importlib.import_module("ifcopenshell")
    written(path := tmp_path / "a.ifc")
    name = b"FILE_SCHEMA(('IFC4X3_ADD2'))"
    path.write_bytes(path.read_bytes().replace(name, b"FILE_SCHEMA(('IFC4XE_NAME('a','',(''),(''),'','','');" + name))
    seen, opened = [], ifcopenshell.open
    monkeypatch.setattr(ifcopenshell, "open", lambda file: (seen.append(Path(file).read_bytes()), opened(file))[1])
    assert len(read_lines(path)[0].pieces) == len(PLAN)
    assert b"IFC4XE" not in seen[0]


def test_a_file_without_data_is_refused(tmp_path: Path) -> None:
    written(path := tmp_path / "a.ifc")
    path.write_bytes(path.read_bytes().replace(b"DATA;", b"DATE;"))
    with pytest.raises(InputError, match="must have a section DATA after the header"):
        read_lines(path)
