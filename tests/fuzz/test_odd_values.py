"""Valid clouds whose values are odd by chance: each tool of clouds, and reconstruction, takes or refuses them."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.arrays import Float
from tests.helpers.files.command_runs import IN, OUT, MakeWorkplace, fuzz_commands
from tests.helpers.files.mutations import for_all
from tests.judges import require

EDGES = (0.0, 1e-9, -1.0, 0.5, 60.0, 1e3, -1e5, 1e6, 4e8, -4e8, 2e9)
FIELDS = {
    "intensity": (0, 1, 65535),
    "classification": (0, 2, 5, 7, 18, 44, 255),
    "return_number": (0, 1, 15),
    "number_of_returns": (0, 1, 15),
    "scan_angle": (0, -30_000, 30_001),
    "point_source_id": (0, 65535),
    "gps_time": (0.0, -1.0, 1e300, float("nan"), float("inf")),
    "red": (0, 65535),
}
NUMBERS = (float("nan"), float("inf"), -float("inf"), 3e38, 1e300, -1.0, 0.0)
"""Values that formats with floating-point numbers can hold anywhere."""
ENDINGS = (".las", ".las", ".laz", ".ply", ".pcd", ".npz", ".e57")
TOOLS = {
    "info": ("cloud", "info", "CLOUD"),
    "subsample": ("cloud", "subsample", "CLOUD", "--grid=0.1", "--output", f"{OUT}/thin.laz"),
    "convert": ("cloud", "convert", "CLOUD", "--output", f"{OUT}/other.ply"),
    "map-intensity": ("cloud", "map-intensity", "CLOUD", f"--target={IN}/plain.las", "--output", f"{OUT}/mapped.laz"),
    "preview": ("cloud", "preview", "CLOUD", "--output", f"{OUT}/pictures"),
    "reconstruct": ("reconstruct", "CLOUD", "--no-picture", "--output", f"{OUT}/road"),
}


def values() -> st.SearchStrategy[dict[str, Any]]:
    """Return descriptions of clouds: how many points, where, on which grid, with which values of which fields."""
    triple = st.tuples(*[st.sampled_from(EDGES)] * 3)
    place = st.tuples(*[st.sampled_from((0.0, 0.0, 294_000.0, 5_628_000.0, *EDGES))] * 3)
    strip = st.tuples(*(st.sampled_from((length, length, *EDGES)) for length in (60.0, 12.0, 0.05)))
    odd = st.dictionaries(st.sampled_from(sorted(FIELDS)), st.integers(0, 99), max_size=4)
    return st.fixed_dictionaries(
        {
            "count": st.sampled_from([0, 1, 2, 10, 300, 2000, 4000]),
            "low": place,
            "span": strip,
            "strays": st.lists(triple, max_size=3),
            "scale": st.sampled_from([1e-9, 1e-4, 1e-3, 1e-3, 0.01, 1.0, 1e3]),
            "version": st.sampled_from([("1.2", 0), ("1.2", 3), ("1.4", 6), ("1.4", 7)]),
            "fields": odd,
            "share": st.sampled_from([0.0, 0.01, 1.0]),
            "tool": st.sampled_from(tuple(TOOLS)),
            "ending": st.sampled_from(ENDINGS),
            "numbers": st.lists(st.tuples(st.integers(0, 2**31), st.sampled_from(NUMBERS)), max_size=3),
        }
    )


def write(path: Path, case: dict[str, Any]) -> bool:
    """Write a cloud as described; return whether LAS can hold it."""
    rng = np.random.default_rng(case["count"])
    low, span = np.array(case["low"]), np.array(case["span"])
    xyz = np.concatenate([low + span * rng.random((case["count"], 3)), np.reshape(case["strays"], (-1, 3))])
    version, kind = case["version"]
    header = laspy.LasHeader(point_format=kind, version=version)
    reach = np.abs(xyz - np.floor(low)).max(initial=0.0) / 2**30
    header.scales, header.offsets = np.full(3, max(case["scale"], reach)), np.floor(low)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.intensity = rng.integers(0, 60_000, len(xyz))
    for name, number in case["fields"].items():
        if name in las.point_format.dimension_names:
            value, old = FIELDS[name][number % len(FIELDS[name])], np.array(las[name])
            most = np.iinfo(old.dtype).max if old.dtype.kind in "iu" else np.inf
            old[rng.random(len(old)) < case["share"]] = min(value, most)  # not a number stays so: it comes first
            try:
                las[name] = old
            except OverflowError:  # older formats have fewer bits
                return False
    if path.suffix in (".las", ".laz"):
        las.write(path)
    elif path.suffix == ".e57" and not len(xyz):  # pye57 writes no empty ones
        return False
    else:
        write_floats(path, np.column_stack([las.x, las.y, las.z, las.intensity]), case["numbers"])
    return True


def write_floats(path: Path, rows: Float, numbers: list[tuple[int, float]]) -> None:
    """Write x, y, z and intensity (N, 4) as others do, with some of these numbers replaced."""
    for place, value in numbers if rows.size else ():
        if path.suffix != ".e57" or abs(value) <= 1.0:  # libE57 writes no number that is none, nor 1e300
            rows.flat[place % rows.size] = value
    names = ("x", "y", "z", "intensity")
    if path.suffix == ".npz":
        np.savez(path, xyz=rows[:, :3], intensity=rows[:, 3])
    elif path.suffix == ".ply":
        lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
        lines += [*(f"property double {name}" for name in names), "end_header\n"]
        path.write_bytes("\n".join(lines).encode() + rows.astype("<f8").tobytes())
    else:
        require("pye57")
        e57 = importlib.import_module("pye57").E57(str(path), mode="w")
        fields = (*(f"cartesian{axis}" for axis in "XYZ"), "intensity")
        e57.write_scan_raw({name: rows[:, number].copy() for number, name in enumerate(fields)})
        e57.close()


@fuzz_commands(6, 1200)
def test_each_tool_takes_or_refuses_them(tmp_path: Path, workplace: MakeWorkplace, count: int) -> None:
    pytest.importorskip("scipy", reason="reconstruction needs SciPy")
    (tmp_path / "in").mkdir()
    sound = {"count": 300, "low": (0, 0, 0), "span": (60, 8, 0.5), "strays": [], "scale": 0.001}
    write(tmp_path / "in" / "plain.las", {**sound, "version": ("1.4", 6), "fields": {}, "share": 0.0, "numbers": []})
    places = {tool: workplace(tmp_path, f"{tool}: cloud with odd values", writes=tool != "info") for tool in TOOLS}

    def body(case: dict[str, Any]) -> None:
        cloud, tool = tmp_path / f"cloud{case['ending']}", case["tool"]
        if write(cloud, case):
            words = [f"{IN}/{cloud.name}" if word == "CLOUD" else word for word in TOOLS[tool]]
            places[tool].run((words, {cloud.name: cloud.read_bytes()}))

    for_all(values(), count, body)
