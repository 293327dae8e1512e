"""The wheel, installed outside of any checkout, finds what comes with it from a folder with files of other things."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.doors.environments import places, run

pytestmark = pytest.mark.doors

_SMALL = (
    *("--fidelity", "draft", "--quiet", "--set", "road.length=60", "--set", "road.half_width=20"),
    *("--set", "scan.platform.speed=30"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a working folder with things of other projects that are called as parts of ours are."""
    made = tmp_path_factory.mktemp("elsewhere")
    for name in ("headless", "ml", "synthroads_addon", "numpy"):
        (made / name).mkdir()
        (made / name / "__init__.py").write_text(f"raise RuntimeError('{name} of another project')\n", encoding="utf-8")
    (made / "presets").mkdir()
    (made / "rq31-600m").mkdir()
    return made


def test_it_is_installed_from_the_wheel_alone(folder: Path) -> None:
    code = "import synthroads_addon, sys; print(synthroads_addon.__file__)"
    answer = run(places()["wheel"], "-P", "-c", code, folder=folder)
    assert Path(answer.stdout.strip()).is_relative_to(Path(places()["wheel"]).parents[1]), answer.stderr


def test_list_finds_presets(folder: Path) -> None:
    answer = run(places()["wheel"], "synthroads", "list", "devices", "--json", folder=folder)
    assert answer.returncode == 0, answer.stderr
    assert len(json.loads(answer.stdout)) >= 1
    answer = run(places()["wheel"], "synthroads", "list", "models", folder=folder)
    assert answer.returncode == 0, answer.stderr


def test_generate_scan_and_predict(folder: Path) -> None:
    if not places()["every_line"]:
        pytest.skip("a wheel holds the same for each Python: its commands are run on one; make doors: on both")
    python = places()["wheel"]
    answer = run(python, "synthroads", "generate", "--output", "out/road", *_SMALL, folder=folder)
    assert answer.returncode == 0, answer.stderr
    assert (folder / "out/road/cloud.laz").stat().st_size > 10_000
    report = json.loads((folder / "out/road/report.json").read_text(encoding="utf-8"))
    assert report["counts"]["kernels"].startswith("packets of "), "the kernels come with the wheel"
    words = ("scan", "out/road/scene.blend", "--height", "40", "--fidelity", "draft", "--output", "out/scanned")
    answer = run(python, "synthroads", *words, "--speed", "40", "--quiet", folder=folder)
    assert answer.returncode == 0, answer.stderr
    answer = run(python, "synthroads", "predict", "out/road/cloud.laz", "--output", "labelled.laz", folder=folder)
    if "ml" in places()["extras"]:
        assert answer.returncode == 0, answer.stderr
        assert (folder / "labelled.laz").exists()
    else:
        assert (answer.returncode, len(answer.stderr.splitlines())) == (2, 1), answer.stderr
        assert "pip install 'synthroads[ml]'" in answer.stderr
