"""Fields that say how a job is done, or what is written, change no point: nothing but the files that they name."""

import hashlib
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.effects.field_paths import with_value
from tests.helpers.effects.scans import SCAN
from tests.helpers.effects.written_fields import WRITTEN

pytestmark = [pytest.mark.any_blender, pytest.mark.keep_scene, pytest.mark.slow]

SHADES = ("red", "green", "blue", "intensity")

JOB: dict[str, Any] = {
    "road": {
        "length": 60.0,
        "half_width": 30.0,
        "trees_per_hectare": 0.0,
        "vehicles": {"per_km": {"minimum": 0.0, "maximum": 0.0}},
    },
    "outputs": ["parameters", "cloud", "centerline", "previews"],
    "twin": ["ifc"],
    "ifc": {"placement": "linear"},
}
"""A job with files of every kind on a road where nothing moves; as JSON data."""


def scenario_of(path: str = "") -> Scenario:
    """Return the job's scenario, with a field changed if one is named."""
    data: Any = SCAN | JOB
    return Scenario.from_dict(with_value(data, path, WRITTEN[path].value) if path else data)


def digests(folder: Path) -> dict[str, str]:
    """Return the files of a job but its report, which says how long it took, with a digest of each."""
    files = [path for path in folder.iterdir() if path.name != "report.json"]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def by_pulse(file: Path) -> dict[str, Any]:
    """Return every dimension of a cloud's first returns, in the order of their pulses."""
    cloud = laspy.read(file)
    first = np.flatnonzero(np.asarray(cloud.return_number) == 1)
    return {name: np.asarray(cloud[name])[first] for name in cloud.point_format.dimension_names}


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the job as it is."""
    folder = tmp_path_factory.mktemp("written") / "usual"
    generate(Job(scenario_of(), folder))
    return folder


@pytest.mark.parametrize("path", sorted(WRITTEN))
def test_nothing_changes_but_what_the_field_names(usual: Path, tmp_path: Path, path: str) -> None:
    generate(Job(scenario_of(path), tmp_path / "out"))
    before, after, promised = digests(usual), digests(tmp_path / "out"), WRITTEN[path]
    assert after.keys() - before.keys() == promised.adds
    assert before.keys() - after.keys() == promised.removes
    changed = {name for name in before.keys() & after.keys() if before[name] != after[name]}
    assert promised.changes <= changed <= promised.changes | promised.ties
    if "cloud.laz" in promised.changes | promised.ties:
        was, now = (by_pulse(folder / "cloud.laz") for folder in (usual, tmp_path / "out"))
        assert {"X", "Y", "Z", "intensity", "red", "class_id"} <= was.keys() & now.keys()
        _, mine, theirs = np.intersect1d(was["gps_time"], now["gps_time"], return_indices=True)
        assert len(mine) >= promised.same * max(len(was["X"]), len(now["X"]))
        for name in was.keys() & now.keys():
            digits = promised.digits if name in SHADES else 0
            apart = np.abs(was[name][mine].astype(np.float64) - now[name][theirs])
            assert np.mean(apart <= digits) >= promised.same, name


def test_sections_are_scanned_one_by_one() -> None:
    road = JOB["road"]["length"]
    assert (scenario_of().section_length(road), scenario_of("scan.section_length").section_length(road)) == (None, 25.0)
