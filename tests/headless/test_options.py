"""Options of the commands: what they say of themselves, and what they mean."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from headless import cli, commands, dataset, generate, scan
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs


def test_changes_of_a_data_set_are_of_the_type_of_their_field() -> None:
    changed = dataset.change_recipe(load_recipe("small-gantries"), ["cloud.classes=5", "title=7", "road.length=200"])
    scenarios = [job.scenario for job in scene_jobs(changed)]
    assert {(one.cloud.classes, one.title, one.road.length) for one in scenarios} == {("5", "7", 200.0)}


def test_changes_of_a_data_set_hold_for_every_variant() -> None:
    recipe = load_recipe("small-roads")
    assert len({job.scenario.road.cross_section for job in scene_jobs(recipe)}) == 4
    changed = dataset.change_recipe(recipe, ["road.design_class=EKA2", "road.cross_section=RQ28"])
    assert {job.scenario.road.cross_section for job in scene_jobs(changed)} == {"RQ28"}


def parsed(*words: str) -> Any:
    return cli.build_parser().parse_args(words)


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the one line with which a command refuses its arguments."""
    try:
        code = cli.main(words)
    except SystemExit as error:
        code = int(str(error.code))
    said = capsys.readouterr().err
    assert code == 2, said
    assert said.count("\n") == 1
    return said


def parsers(parser: argparse.ArgumentParser, name: str = "") -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield every command and tool with its parser."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for tool, its_parser in action.choices.items():
                yield from parsers(its_parser, f"{name} {tool}".strip())
    yield name, parser


PARSERS = dict(parsers(cli.build_parser()))


def texts_of(default: object) -> list[str]:
    """Return a default as the texts that help has to name."""
    values = default if isinstance(default, (list, tuple)) else [default]
    return [f"{value:g}" if isinstance(value, float) else str(value) for value in values]


def unnamed(parser: argparse.ArgumentParser) -> list[str]:
    """Return the arguments that have a default which their help doesn't name in parentheses."""
    found = []
    for action in parser._actions:
        if action.default in (None, False, [], argparse.SUPPRESS) or action.help == argparse.SUPPRESS:
            continue
        said = re.findall(r"\(([^()]*)\)", parser._get_formatter()._expand_help(action))
        words = {*said, *(word for text in said for word in re.split(r"[\s,;:]+", text))}
        everything = "all" in words and all(text in str(action.help) for text in texts_of(action.default))
        if not everything and not set(texts_of(action.default)) <= words:
            found.append(f"{'/'.join(action.option_strings) or action.dest} is {action.default!r}: {action.help}")
    return found


@pytest.mark.parametrize("name", PARSERS)
def test_help_names_every_default(name: str) -> None:
    assert PARSERS[name].format_help()
    assert unnamed(PARSERS[name]) == []


def test_a_default_that_help_does_not_name_is_found() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--width", type=float, default=2.0, help="width, m (2)")
    parser.add_argument("--wide", type=float, default=2.0, help="width, m (20)")
    parser.add_argument("--formats", nargs="+", default=["laz", "ply"], help="formats: laz, ply")
    assert [text.split()[0] for text in unnamed(parser)] == ["--wide", "--formats"]


def test_tolerance_means_one_thing(capsys: pytest.CaptureFixture[str]) -> None:
    with_it = {name for name, parser in PARSERS.items() if "--tolerance" in parser.format_help()}
    assert with_it == {"generate", "scan"}
    for words in (["twin", "road.json"], ["reconstruct", "cloud.laz"]):
        said = refusal(capsys, *words, "--output", "out", "--tolerance", "0.01")
        assert re.search(r"--tolerance is now --(max-deviation|fit-tolerance)\n", said)


def test_device_is_short_for_its_field() -> None:
    words = ["generate", "--output", "out", "--device", "riegl-vux-1uav22"]
    assert commands.all_changes(parsed(*words), generate._FIELDS) == ['scan.device="riegl-vux-1uav22"']
    same = [*words, "--set", "scan.device=riegl-vux-1uav22", "--seed", "7", "--twin", "ifc"]
    assert commands.all_changes(parsed(*same), generate._FIELDS)[1:] == [
        'scan.device="riegl-vux-1uav22"',
        "seed=7",
        'twin=["ifc"]',
    ]
    scenario = scan.scenario_of(parsed("scan", "scene.obj", "--output", "out", "--device", "velodyne-vlp-16"))
    assert scenario.scan.device == "velodyne-vlp-16"


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["--device", "generic-grid", "--set", "scan.device=livox-mid-70"], "--device is 'generic-grid': contradicts"),
        (["--device", "generic-grid", "--set", 'scan={"device": "livox-mid-70"}'], "--set scan.device=livox-mid-70"),
        (["--seed", "7", "--set", "seed=8"], "--seed is 7: contradicts --set seed=8"),
        (["--fidelity", "draft", "--set", "fidelity=high"], "--fidelity is 'draft': contradicts --set fidelity=high"),
    ],
)
def test_options_that_set_contradicts_are_refused(
    words: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--output", str(tmp_path / "out")]
    assert wanted in refusal(capsys, "generate", *out, *words)
    assert wanted in refusal(capsys, "scan", str(tmp_path / "scene.obj"), *out, *words)
    assert "scan.device is 'livox': must be a .json file" in refusal(capsys, "generate", *out, "--device", "livox")
    assert not (tmp_path / "out").exists()


def first_set(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert cli.main(["parameters", "--length", "300", *words]) == 0
    made: dict[str, Any] = json.loads(capsys.readouterr().out)
    return made


def test_one_of_design_class_and_cross_section_is_enough(capsys: pytest.CaptureFixture[str]) -> None:
    for words, name in (
        (["--design-class", "EKA3"], "rq25-eka3-1"),
        (["--set", "road.design_class=EKA3"], "rq25-eka3-1"),
        (["--design-class", "EKA2"], "rq28-eka2-1"),
        (["--cross-section", "RQ31.5"], "rq31.5-eka3-1"),
        ([], "rq31-eka1a-1"),
    ):
        assert first_set(capsys, *words)["metadata"]["identifier"] == name
    both = refusal(capsys, "parameters", "--design-class", "EKA3", "--cross-section", "RQ31")
    assert "cross_section is 'RQ31': EKA3 allows" in both
    twice = refusal(capsys, "parameters", "--design-class", "EKA3", "--set", "road.design_class=EKA2")
    assert "--design-class is 'EKA3': contradicts --set road.design_class=EKA2" in twice
