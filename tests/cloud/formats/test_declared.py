"""Declarations of others' files on their points are used, refused or told: a table of cases for each kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.cloud.flags import FLAGS
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from tests.helpers.clouds.declaring_files import COUNT, EVERY_FIFTH, PLACES, e57_file, las_file, ply_file
from tests.helpers.clouds.random_points import make_points
from tests.judges import require

Write = Callable[[Path], Path]
NAN_FIFTH = np.where(EVERY_FIFTH, np.nan, 5.0)


@dataclass(frozen=True)
class Case:
    """A file and what is to come of it.

    Attributes:
        write: writes it into a folder.
        arrays: what the points have, or one value for all.
        told: parts of what the user is told, each in one sentence; nothing else may be told.
        refused: part of the error in place of all that.
        usable: number of points that may be worked with.
    """

    write: Write
    arrays: dict[str, object]
    told: tuple[str, ...] = ()
    refused: str = ""
    usable: int = COUNT


def rgb(kind: str, value: object, names: tuple[str, ...] = ("red", "green", "blue")) -> dict[str, tuple[str, object]]:
    return dict.fromkeys(names, (kind, value))


def las(kind: int = 6, **dimensions: object) -> Write:
    return lambda folder: las_file(folder / "cloud.las", kind, **dimensions)


def laz(kind: int = 6, **dimensions: object) -> Write:
    return lambda folder: las_file(folder / "cloud.laz", kind, **dimensions)


def ply(columns: dict[str, tuple[str, object]], element: str = "vertex") -> Write:
    return lambda folder: ply_file(folder / "cloud.ply", columns, element)


def npz(**arrays: np.ndarray) -> Write:
    def write(folder: Path) -> Path:
        np.savez(folder / "cloud.npz", xyz=PLACES, **arrays)
        return folder / "cloud.npz"

    return write


def e57(columns: dict, limits: dict | None = None, **more: object) -> Write:
    return lambda folder: e57_file(folder / "cloud.e57", columns, limits, **more)


def e57_rgb(values: object, kind: str, low: float, high: float) -> dict:
    return dict.fromkeys(("colorRed", "colorGreen", "colorBlue"), (values, kind, low, high))


def color_limits(low: float, high: float) -> dict:
    channels = ("colorRed", "colorGreen", "colorBlue")
    return {
        "colorLimits": {f"{name}{end}": at for name in channels for end, at in (("Minimum", low), ("Maximum", high))}
    }


def intensity_limits(low: float, high: float) -> dict:
    return {"intensityLimits": {"intensityMinimum": low, "intensityMaximum": high}}


def noise_codes(*codes: int) -> np.ndarray:
    return np.where(EVERY_FIFTH, np.resize(codes, COUNT), 2).astype(np.uint8)


WITHHELD = "4 points are withheld and left out"
NOISE = "4 points of a class of noise (LAS codes 7 and 18) are left out"
EIGHT_BIT_COLORS = "its colours, 128 at most, are read as 8 bits (0 to 255)"
INVALID_INTENSITY = "4 points have an invalid intensity: it is read as 0"
WIDE = {"isIntensityInvalid": (EVERY_FIFTH, "int", 0, 1)}
HALF = 128 * 257
SHARES = np.arange(COUNT) / COUNT

CASES: dict[str, Case] = {
    # Flags and noise.
    "las withheld": Case(las(withheld=EVERY_FIFTH), {"withheld": EVERY_FIFTH}, (WITHHELD,), usable=16),
    "laz withheld, LAS 1.2": Case(laz(3, version="1.2", withheld=EVERY_FIFTH), {}, (WITHHELD,), usable=16),
    "las low noise": Case(las(classification=noise_codes(7)), {"class_id": noise_codes(7)}, (NOISE,), usable=16),
    "las high noise": Case(las(classification=noise_codes(18)), {"class_id": noise_codes(18)}, (NOISE,), usable=16),
    "laz noise, LAS 1.2": Case(laz(1, version="1.2", classification=noise_codes(7)), {}, (NOISE,), usable=16),
    "las withheld noise counts once": Case(
        las(classification=noise_codes(7), withheld=EVERY_FIFTH), {}, (WITHHELD,), usable=16
    ),
    "las synthetic": Case(las(synthetic=EVERY_FIFTH), {"synthetic": EVERY_FIFTH}),
    "las overlap": Case(las(overlap=EVERY_FIFTH), {"overlap": EVERY_FIFTH}),
    "las key points": Case(las(key_point=EVERY_FIFTH), {"key_point": EVERY_FIFTH}),
    "las edge of flight line": Case(las(edge_of_flight_line=EVERY_FIFTH), {"edge_of_flight_line": EVERY_FIFTH}),
    "las user data": Case(laz(user_data=np.arange(COUNT)), {"user_data": np.arange(COUNT)}),
    "las scanner channel": Case(las(scanner_channel=np.arange(COUNT) % 4), {"scanner_channel": np.arange(COUNT) % 4}),
    "ply withheld of PDAL": Case(ply({"withheld": ("u1", EVERY_FIFTH)}), {}, (WITHHELD,), usable=16),
    "ply withheld of CloudCompare": Case(
        ply({"scalar_Withheld_flag": ("<f4", EVERY_FIFTH)}), {"withheld": EVERY_FIFTH}, (WITHHELD,), usable=16
    ),
    "ply noise": Case(ply({"classification": ("u1", noise_codes(18))}), {}, (NOISE,), usable=16),
    "npz withheld": Case(npz(withheld=EVERY_FIFTH), {}, (WITHHELD,), usable=16),
    # Invalid fields of E57.
    "e57 invalid intensity, filler 9e9": Case(
        e57({"intensity": (np.where(EVERY_FIFTH, 9e9, 0.5), "float", -np.inf, np.inf), **WIDE}),
        {"intensity": np.where(EVERY_FIFTH, 0.0, 0.5)},
        (INVALID_INTENSITY,),
    ),
    "e57 invalid intensity, NaN": Case(
        e57({"intensity": (np.where(EVERY_FIFTH, np.nan, 0.5), "float", -np.inf, np.inf), **WIDE}),
        {"intensity": np.where(EVERY_FIFTH, 0.0, 0.5)},
        (INVALID_INTENSITY,),
    ),
    "e57 invalid intensity within limits": Case(
        e57({"intensity": (np.where(EVERY_FIFTH, 1023, 0), "int", -1024, 1023), **WIDE}),
        {"intensity": np.where(EVERY_FIFTH, 0.0, 1024 / 2047)},
        (INVALID_INTENSITY,),
    ),
    "e57 NaN that isn't called invalid": Case(
        e57({"intensity": (NAN_FIFTH, "float", -np.inf, np.inf)}), {}, refused="intensity of point 0"
    ),
    "e57 invalid colour": Case(
        e57({**e57_rgb(128, "int", 0, 255), "isColorInvalid": (EVERY_FIFTH, "int", 0, 1)}, color_limits(0, 255)),
        {"rgb": np.where(EVERY_FIFTH, 0, HALF)[:, None]},
        ("4 points have an invalid colour: it is read as 0",),
    ),
    "e57 invalid time": Case(
        e57({"timeStamp": (7.0, "float", 0.0, 1e9), "isTimeStampInvalid": (EVERY_FIFTH, "int", 0, 1)}),
        {"gps_time": np.where(EVERY_FIFTH, 0.0, 7.0)},
        ("4 points have an invalid time: it is read as 0",),
    ),
    "e57 invalid places": Case(
        e57({"cartesianInvalidState": (EVERY_FIFTH * 2, "int", 0, 2)}),
        {"xyz": PLACES[~EVERY_FIFTH]},
        ("4 points have no valid coordinates and are left out",),
        usable=16,
    ),
    "e57 directions only": Case(
        e57({"cartesianInvalidState": (EVERY_FIFTH * 1, "int", 0, 2)}),
        {"xyz": PLACES[~EVERY_FIFTH]},
        ("4 points have no valid coordinates and are left out",),
        usable=16,
    ),
    # Colours.
    "e57 8 bits": Case(e57(e57_rgb(128, "int", 0, 255), color_limits(0, 255)), {"rgb": HALF}),
    "e57 16 bits": Case(e57(e57_rgb(HALF, "int", 0, 65535), color_limits(0, 65535)), {"rgb": HALF}),
    "e57 16 bits by the field's limits": Case(e57(e57_rgb(HALF, "int", 0, 65535)), {"rgb": HALF}),
    "e57 10 bits": Case(e57(e57_rgb(1023, "int", 0, 1023), color_limits(0, 1023)), {"rgb": 65535}),
    "e57 shares": Case(e57(e57_rgb(0.5, "float", 0.0, 1.0), color_limits(0.0, 1.0)), {"rgb": 32768}),
    "e57 scaled integers": Case(e57(e57_rgb(500, "scaled", 0, 1000)), {"rgb": 32768}),
    "e57 floats without limits": Case(
        e57(e57_rgb(127.5, "float", -np.inf, np.inf)),
        {"rgb": 32768},
        ("its colours, 127.5 at most, are read as 8 bits (0 to 255)",),
    ),
    "e57 shares without limits": Case(
        e57(e57_rgb(0.5, "float", -np.inf, np.inf)),
        {"rgb": 32768},
        ("its colours, 0.5 at most, are read as shares from 0 to 1",),
    ),
    "e57 beyond its limits": Case(
        e57(e57_rgb(np.where(EVERY_FIFTH, 300, 128), "int", 0, 65535), color_limits(0, 255)),
        {"rgb": np.where(EVERY_FIFTH, 65535, HALF)[:, None]},
        ("12 points have a colour beyond the file's limits: they are clipped",),
    ),
    "las 8 bits": Case(las(7, red=128, green=128, blue=128), {"rgb": HALF}, (EIGHT_BIT_COLORS,)),
    "laz 8 bits, LAS 1.2": Case(
        laz(3, version="1.2", red=128, green=128, blue=128), {"rgb": HALF}, (EIGHT_BIT_COLORS,)
    ),
    "laz 16 bits": Case(laz(7, red=HALF, green=1, blue=0), {"rgb": [[HALF, 1, 0]]}),
    "las without colours": Case(las(7), {"rgb": 0}),
    "ply uchar": Case(ply(rgb("u1", 128)), {"rgb": HALF}),
    "ply ushort": Case(ply(rgb("<u2", HALF)), {"rgb": HALF}),
    "ply ushort of 8 bits": Case(ply(rgb("<u2", 128)), {"rgb": HALF}, (EIGHT_BIT_COLORS,)),
    "ply int of 8 bits": Case(ply(rgb("<i4", 128)), {"rgb": HALF}, (EIGHT_BIT_COLORS,)),
    "ply shares": Case(ply(rgb("<f4", 0.5)), {"rgb": 32768}, ("0.5 at most, are read as shares from 0 to 1",)),
    "ply floats to 255": Case(ply(rgb("<f4", 127.5)), {"rgb": 32768}, ("127.5 at most, are read as 8 bits",)),
    "ply floats to 65535": Case(
        ply(rgb("<f8", float(HALF))), {"rgb": HALF}, ("at most, are read as numbers from 0 to 65,535",)
    ),
    "ply floats with NaN": Case(
        ply(rgb("<f4", np.where(EVERY_FIFTH, np.nan, 1.0))),
        {"rgb": np.where(EVERY_FIFTH, 0, 65535)[:, None]},
        ("1 at most, are read as shares from 0 to 1",),
    ),
    "ply diffuse": Case(ply(rgb("u1", 128, ("diffuse_red", "diffuse_green", "diffuse_blue"))), {"rgb": HALF}),
    "ply r g b": Case(ply(rgb("u1", 128, ("r", "g", "b"))), {"rgb": HALF}),
    "npz uint8": Case(npz(rgb=np.full((COUNT, 3), 128, np.uint8)), {"rgb": HALF}),
    "npz shares": Case(npz(rgb=np.full((COUNT, 3), 0.5)), {"rgb": 32768}, ("0.5 at most, are read as shares",)),
    # Intensities of E57.
    "e57 intensity, 16 bits": Case(
        e57({"intensity": (SHARES * 65535, "int", 0, 65535)}, intensity_limits(0, 65535)),
        {"intensity": np.floor(SHARES * 65535) / 65535},
    ),
    "e57 intensity, -1024 to 1023": Case(
        e57({"intensity": (np.arange(COUNT) - 1024, "int", -1024, 1023)}, intensity_limits(-1024, 1023)),
        {"intensity": np.arange(COUNT) / 2047},
    ),
    "e57 intensity by the field's limits": Case(
        e57({"intensity": (np.arange(COUNT) - 1024, "int", -1024, 1023)}), {"intensity": np.arange(COUNT) / 2047}
    ),
    "e57 intensity beyond its limits": Case(
        e57({"intensity": (np.where(EVERY_FIFTH, 3.0, 0.5), "float", -9.0, 9.0)}, intensity_limits(0.0, 1.0)),
        {"intensity": np.where(EVERY_FIFTH, 1.0, 0.5)},
        ("4 points have an intensity beyond the file's limits: they are clipped",),
    ),
    "e57 limits of every scan": Case(
        e57(
            {"intensity": (100, "int", 0, 65535)},
            scans=2,
            spans={0: intensity_limits(0, 200), 1: intensity_limits(0, 400)},
        ),
        {"intensity": np.repeat([0.5, 0.25], COUNT)},
        usable=2 * COUNT,
    ),
    # Numbers that don't fit into the 8 bits of a class, or aren't whole.
    "ply label 258": Case(
        ply({"label": ("<i4", np.where(EVERY_FIFTH, 258, 3))}),
        {},
        refused="class_id of point 0 is 258: must",
    ),
    "ply label -7": Case(ply({"label": ("<i2", -7)}), {}, refused="class_id of point 0 is -7"),
    "ply label 2.6": Case(ply({"scalar_Classification": ("<f4", 2.6)}), {}, refused="class_id of point 0 is 2.59"),
    "ply label NaN": Case(
        ply({"scalar_Classification": ("<f4", NAN_FIFTH)}),
        {"class_id": np.where(EVERY_FIFTH, 0, 5)},
        ("4 points have no class_id (NaN or -1): it is read as 0",),
    ),
    "ply label -1": Case(
        ply({"classification": ("<i4", np.where(EVERY_FIFTH, -1, 5))}),
        {"class_id": np.where(EVERY_FIFTH, 0, 5)},
        ("4 points have no class_id (NaN or -1): it is read as 0",),
    ),
    "npz class 258": Case(npz(class_id=np.full(COUNT, 258)), {}, refused="class_id of point 0 is 258"),
    "npz strip 70000": Case(npz(strip=np.full(COUNT, 70000)), {}, refused="strip of point 0 is 70000"),
    "ply return 300": Case(ply({"returnnumber": ("<u2", 300)}), {}, refused="return_number of point 0 is 300"),
    "e57 return 300": Case(e57({"returnIndex": (299, "int", 0, 999)}), {}, refused="return_number of point 0 is 300"),
    # Names.
    "ply of CloudCompare": Case(
        ply(
            {
                "scalar_Intensity": ("<f4", 300.0),
                "scalar_Classification": ("<f4", 5.0),
                "scalar_GpsTime": ("<f4", 5.0),
                "scalar_ReturnNumber": ("<f4", 1.0),
                "scalar_NumberOfReturns": ("<f4", 2.0),
                "scalar_PointSourceId": ("<f4", 4.0),
            }
        ),
        {
            "intensity": 300.0,
            "class_id": 5,
            "gps_time": 5.0,
            "return_number": 1,
            "number_of_returns": 2,
            "strip": 3,
        },
    ),
    "ply of CloudCompare 2.13": Case(
        ply(
            {
                "scalar_Intensity": ("<f4", 300.0),
                "scalar_Return_Number": ("<f4", 1.0),
                "scalar_Number_Of_Returns": ("<f4", 2.0),
                "scalar_Point_Source_ID": ("<f4", 4.0),
                "scalar_Gps_Time": ("<f4", 5.0),
                "scalar_Scan_Angle": ("<f4", 6.0),
                "scalar_User_Data": ("<f4", 9.0),
            }
        ),
        {
            "intensity": 300.0,
            "gps_time": 5.0,
            "return_number": 1,
            "number_of_returns": 2,
            "strip": 3,
            "scan_angle_deg": 6.0,
            "user_data": 9,
        },
    ),
    "ply of PDAL": Case(
        ply(
            {
                "intensity": ("<u2", 300),
                "returnnumber": ("u1", 1),
                "numberofreturns": ("u1", 2),
                "classification": ("u1", 5),
                "gpstime": ("<f8", 3.9e8),
                "pointsourceid": ("<u2", 4),
                "scananglerank": ("<f4", -12.0),
                "userdata": ("u1", 9),
                "edgeofflightline": ("u1", 1),
            }
        ),
        {
            "intensity": 300.0,
            "class_id": 5,
            "gps_time": 3.9e8,
            "return_number": 1,
            "number_of_returns": 2,
            "strip": 3,
            "scan_angle_deg": -12.0,
            "user_data": 9,
            "edge_of_flight_line": 1,
        },
    ),
    "ply label without a meaning of its own": Case(
        ply({"label": ("u1", 5)}), {"class_id": 5}, ("its property label is read as LAS codes of classes",)
    ),
    "ply of ours, written again without notes": Case(
        ply({"scalar_class_id": ("<f4", 3.0), "scalar_instance_id": ("<f4", 12.0)}),
        {"class_id": 3, "instance_id": 12},
        ("its class_id is read as numbers of the 17 classes",),
    ),
    "ply of another element": Case(ply({"intensity": ("<u2", 300)}, "testing"), {"intensity": 300.0}),
}


@pytest.mark.parametrize("name", CASES)
def test_what_a_file_declares_is_used_or_told(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    if name.startswith("e57"):
        require("pye57")
    path = case.write(tmp_path)
    if case.refused:
        with pytest.raises(InputError) as error, open_cloud(path) as cloud:
            list(cloud.blocks())
        assert case.refused in str(error.value)
        assert "\n" not in str(error.value)
        return
    with collected_remarks() as remarks, open_cloud(path) as cloud:
        usable = concatenate([*cloud.usable_blocks(7)])
        every = concatenate([*cloud.blocks(7)])
    assert len(usable) == case.usable
    for array, values in case.arrays.items():
        found = every.array(array)
        wanted = np.broadcast_to(np.asarray(values, dtype=np.float64), found.shape)
        np.testing.assert_allclose(found, wanted, atol=1e-6, err_msg=array)
    assert not any(flag in usable.more for flag in FLAGS)
    assert len(remarks) == len(case.told), remarks
    for sentence, part in zip(sorted(remarks), sorted(case.told), strict=True):
        assert part in sentence
        assert sentence.startswith("cloud.")


def older_ply(path: Path) -> PointBlock:
    """Write a PLY file of ours and take the prefix away, as version 1 of it had none; return its points."""
    points = make_points(50)
    with open_writer(path, 25832, points.xyz[0], 1000.0) as writer:
        writer.write(points)
    head, body = path.read_bytes().split(b"end_header\n", 1)
    path.write_bytes(head.replace(b" scalar_", b" ") + b"end_header\n" + body)
    return points


def test_our_ply_of_older_versions_is_read(tmp_path: Path) -> None:
    points = older_ply(tmp_path / "cloud.ply")
    with open_cloud(tmp_path / "cloud.ply") as cloud:
        assert (cloud.header.labelled, cloud.header.left_out) == (True, ())
        found = concatenate([*cloud.blocks()])
    for name in ("class_id", "instance_id", "strip", "return_number", "gps_time", "scan_angle_deg", "range"):
        assert found.array(name) == pytest.approx(points.array(name), abs=1e-6), name


def test_our_ply_has_types_and_names_that_others_read(tmp_path: Path) -> None:
    """Open3D's tensor reader skips all types but four; CloudCompare loads scalars whose names begin with scalar_."""
    points = make_points(5)
    with open_writer(tmp_path / "cloud.ply", 25832, points.xyz[0], 1000.0) as writer:
        writer.write(points)
    head = (tmp_path / "cloud.ply").read_bytes().split(b"end_header")[0].decode()
    properties = [line.split()[1:] for line in head.splitlines() if line.startswith("property")]
    assert {kind for kind, _ in properties} <= {"uchar", "int", "float", "double"}
    usual = {"x", "y", "z", "red", "green", "blue", "intensity"}
    assert all(name in usual or name.startswith("scalar_") for _, name in properties)
    assert {"scalar_class_id", "scalar_instance_id", "scalar_strip"} <= {name for _, name in properties}
