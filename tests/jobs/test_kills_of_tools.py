"""Tools for clouds and roads, ended by a signal in the middle: a line at most, and nothing left after the next run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.helpers.clouds.road_clouds import cloud_of, road, write
from tests.helpers.ended_commands import SIGNALS, WORKER, EndedTool, unchanged
from tests.jobs.test_kills import SEED

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="signals as Linux has them"),
]

TOOLS = {
    "tile": ["cloud", "tile", "CLOUD", "--output", "out", "--size", "3"],
    "crop": ["cloud", "crop", "CLOUD", "--output", "out/part.laz", "--heights", "-1e4", "1e4"],
    "subsample": ["cloud", "subsample", "CLOUD", "--output", "out/thin.laz"],
    "convert": ["cloud", "convert", "CLOUD", "--output", "out/cloud.ply"],
    "merge": ["cloud", "merge", "CLOUD", "CLOUD", "--output", "out/both.laz"],
    "map-intensity": ["cloud", "map-intensity", "CLOUD", "--target", "CLOUD", "--output", "out/mapped.laz"],
    "preview": ["cloud", "preview", "CLOUD", "--output", "out"],
    "centerline": ["centerline", "CLOUD", "--run", "none", "--output", "out/deep/line.geojson"],
    "reconstruct": ["reconstruct", "CLOUD", "--output", "out"],
    "calibrate": [
        *("calibrate", "--real", "CLOUD", "--class-field", "class_id", "--material", "asphalt=1"),
        *("--save", "out/table.json"),
    ],
    "compare": ["compare", "CLOUD", "CLOUD", "--output", "out"],
    "twin": ["twin", "ROAD", "--output", "out"],
}
"""Words of each, with its inputs; all that it writes is in a folder ``out`` that it makes."""
ENDS = (*SIGNALS, *SIGNALS, WORKER)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("inputs")
    truth = road("RQ31", "EKA1A", 120.0, 4)
    (folder / "road.json").write_text(truth.to_json(), encoding="utf-8")
    cloud = write(folder / "cloud.laz", cloud_of(truth, 10.0, 4))
    return {"CLOUD": str(cloud), "ROAD": str(folder / "road.json")}


@pytest.mark.parametrize("tool", TOOLS)
def test_a_tool_that_is_ended_in_the_middle_leaves_nothing_after_the_next_run(
    tool: str, inputs: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal to the command itself, or the end of its worker; KILL_SEED=N ends it at other moments than usual."""
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    words = [inputs.get(word, str(tmp_path / word) if word.startswith("out") else word) for word in TOOLS[tool]]
    ended = EndedTool(words, tmp_path / "out", temporary, timed=("report.json", "reconstruction.json"))
    with unchanged(Path(inputs["CLOUD"]).parent):
        ended.end_in_the_middle(ENDS, f"{SEED} {tool}")
    print(tool, dict(ended.ended))
