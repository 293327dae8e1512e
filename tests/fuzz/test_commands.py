"""Commands as people type them, on files made wrong by chance: exit code 0, 2 or 3, in time, never a traceback."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

from hypothesis import strategies as st

from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.fuzz.test_bytes import cloud
from tests.fuzz.test_files import LINES, MANIFEST
from tests.helpers.files.command_figures import FIGURES, Figures
from tests.helpers.files.command_runs import fuzz_commands
from tests.helpers.files.mutations import TOKENS, damaged, for_all, json_files, yaml_files
from tests.helpers.roads.checker_full_road import full

ROOT = Path(__file__).parents[2]
LONGEST = 60.0
"""Seconds by the clock, for the machine may be busy: most of a command's second is what Python takes to begin."""
ROAD = sample_road(RoadScenario(length=60.0), 1).to_dict()
RECIPE = {"title": "t", "groups": [{"name": "a", "scenes": 2, "set": {"fidelity": "draft"}}]}
ARGUMENTS = (
    "0",
    "-1",
    "nan",
    "inf",
    "1e400",
    "",
    "x",
    "99999999999999999999",
    "\udcff",
    "a\nb",
    "[",
    "{}",
    "road.length=[",
)


def answers(module: str, *arguments: str) -> int:
    """Run a command, see that it ends as it should; return its exit code."""
    command = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=LONGEST, check=False)
    said = done.stderr.decode(errors="replace")
    assert done.returncode in (0, 2, 3), f"{command}: {done.returncode}: {said[-2000:]}"
    assert "Traceback" not in said, said[-2000:]
    if done.returncode == 2:
        assert len(said.splitlines()) == 1, said[:2000]
    return done.returncode


def commands(folder: Path) -> st.SearchStrategy[tuple[str, bytes, tuple[str, ...]]]:
    """Return name and content of a file and the command that is to read it (``FILE`` and ``OUT`` are filled in)."""
    laz = cloud(folder / "sound.laz", 200).read_bytes()
    texts = [token for token in TOKENS if len(token) < 100]
    return st.one_of(
        st.tuples(st.just("road.json"), json_files([ROAD, full()]), st.just(("headless.check", "FILE"))),
        st.tuples(
            st.just("road.json"),
            json_files([ROAD]),
            st.just(("headless.twin", "FILE", "--output", "OUT", "--twin", "geojson")),
        ),
        st.tuples(st.just("cloud.laz"), damaged([laz], texts, 900), st.just(("headless.cloud", "info", "FILE"))),
        st.tuples(
            st.just("manifest.json"),
            json_files([MANIFEST]),
            st.just(("headless.dataset", "x", "--output", "IN", "--verify")),
        ),
        st.tuples(
            st.just("recipe.yaml"), yaml_files([RECIPE]), st.just(("headless.dataset", "FILE", "--output", "FILE/x"))
        ),
        st.tuples(
            st.just("line.geojson"),
            json_files(LINES),
            st.just(("headless.cloud", "preview", "SOUND", "--output", "OUT", "--centerline", "FILE", "--overwrite")),
        ),
        st.tuples(
            st.just("x"), st.just(b""), st.sampled_from(ARGUMENTS).map(lambda a: ("headless.parameters", "--length", a))
        ),
        st.tuples(
            st.just("x"), st.just(b""), st.sampled_from(ARGUMENTS).map(lambda a: ("headless.parameters", "--set", a))
        ),
        st.tuples(st.just("x"), st.just(b""), st.sampled_from(ARGUMENTS).map(lambda a: ("headless.check", a))),
    )


@fuzz_commands(3, 200)
def test_commands(tmp_path: Path, count: int, record_property: Callable[[str, object], None]) -> None:
    figures = Figures("commands in processes of their own")

    def body(case: tuple[str, bytes, tuple[str, ...]]) -> None:
        name, content, (module, *arguments) = case
        (tmp_path / name).write_bytes(content)
        places = {"FILE": tmp_path / name, "OUT": tmp_path / "out", "IN": tmp_path, "SOUND": tmp_path / "sound.laz"}
        filled = [str(places[a]) if a in places else a.replace("FILE", str(places["FILE"])) for a in arguments]
        before = getrusage(RUSAGE_CHILDREN)
        code = answers(module, *filled, *(["--overwrite"] if module == "headless.twin" else []))
        after = getrusage(RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        figures.add(code, seconds, after.ru_maxrss / 1000.0)

    for_all(commands(tmp_path), count, body)
    record_property(FIGURES, asdict(figures))


def test_names_of_files_that_are_no_text(tmp_path: Path) -> None:
    """Names in the file system needn't be UTF-8; they are shown escaped."""
    road = tmp_path / "road.json"
    road.write_text(json.dumps(ROAD))
    folder = str(tmp_path / "out-\udcff")
    command = [sys.executable, "-m", "headless.twin", str(road), "--output", folder, "--twin", "geojson"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert rb"out-\udcff" in done.stdout
