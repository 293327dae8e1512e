"""Options of the commands: what they say of themselves, and what they mean."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from headless import cli, generate, options, scan
from synthroads_addon.dataset.changes import change_recipe
from synthroads_addon.dataset.recipe import load_recipe, scene_jobs
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

NEEDS_TORCH = pytest.mark.skipif(find_spec("torch") is None, reason="needs PyTorch")


def test_changes_of_a_data_set_are_of_the_type_of_their_field() -> None:
    changed = change_recipe(load_recipe("small-gantries"), ["cloud.classes=5", "title=7", "road.length=200"])
    scenarios = [job.scenario for job in scene_jobs(changed)]
    assert {(one.cloud.classes, one.title, one.road.length) for one in scenarios} == {("5", "7", 200.0)}


def test_changes_of_a_data_set_hold_for_every_variant() -> None:
    recipe = load_recipe("small-roads")
    assert len({job.scenario.road.cross_section for job in scene_jobs(recipe)}) == 4
    changed = change_recipe(recipe, ["road.design_class=EKA2", "road.cross_section=RQ28"])
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
    assert options.all_changes(parsed(*words), generate._FIELDS) == ['scan.device="riegl-vux-1uav22"']
    same = [*words, "--set", "scan.device=riegl-vux-1uav22", "--seed", "7", "--twin", "ifc"]
    assert options.all_changes(parsed(*same), generate._FIELDS)[1:] == [
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


@pytest.mark.parametrize(
    ("option", "change", "name"),
    [
        ("--axis", "road.length=100", "length"),
        ("--axis", "road.radius.minimum=800", "radius"),
        ("--axis", 'road={"half_width": 30, "grade_percent": {"maximum": 3}}', "grade_percent"),
        ("--axis", "road.map_origin=[1,2,3]", "map_origin"),
        ("--parameters", "road.length=100", "length"),
        ("--parameters", "road.barriers.concrete_median=1", "barriers"),
    ],
)
def test_fields_of_the_road_without_effect_beside_an_axis_or_parameters_are_refused(
    option: str, change: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--output", str(tmp_path / "out")]
    said = refusal(capsys, "generate", *out, option, str(tmp_path / "none"), "--set", change)
    assert f"road.{name} has no effect with {option}, whose file says" in said
    allowed = refusal(capsys, "generate", *out, option, str(tmp_path / "none"), "-q", "--set", "scan.threads=1")
    assert "none" in allowed, "the file is looked for then"
    assert "no effect" not in allowed


def test_fields_with_effect_beside_an_axis_are_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "generate",
        "--output",
        str(tmp_path / "out"),
        "--axis",
        str(tmp_path / "none"),
        "-q",
        "--set",
        "road.lanes=2",
    ]
    assert "no effect" not in refusal(capsys, *words)


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


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["genrate"], "generate"),
        (["cloud", "inof", "x.laz"], "info"),
        (["generate", "--outptu", "out"], "--output"),
        (["cloud", "preview", "x.laz", "--output", "out", "--statoin=5"], "--station"),
        (["generate", "-o", "out", "--fidelity", "drft"], "draft"),
        (["generate", "-o", "out", "--without", "nosie"], "noise"),
        (["generate", "-o", "out", "--set", "lenght=120"], "road.length"),
        (["generate", "-o", "out", "--set", "devise=x"], "scan.device"),
        (["generate", "-o", "out", "--set", "road.lenght=120"], "length"),
        (["generate", "-o", "out", "--set", "fidelty=draft"], "fidelity"),
        (["generate", "-o", "out", "--twin", "cityjsn"], "cityjson"),
        (["twin", "road.json", "-o", "out", "--twin", "opendriv"], "opendrive"),
        (["generate", "-o", "out", "--scenario", "rq31-60m"], "rq31-600m"),
        (["generate", "-o", "out", "--device", "velodyne-vlp16"], "velodyne-vlp-16"),
        (["generate", "-o", "out", "--device", "VLP 16"], "velodyne-vlp-16"),
        (["generate", "-o", "out", "--device", "vz600"], "riegl-vz-600i"),
        (
            ["generate", "-o", "out", "--device", "velodyne"],
            "velodyne-hdl-32e', 'velodyne-hdl-64e' or 'velodyne-vlp-16",
        ),
        (["generate", "-o", "out", "--set", "scan.height=50"], "scan.platform.height"),
        (["generate", "-o", "out", "--set", "scan.platform.device=x"], "scan.device"),
        (["generate", "-o", "out", "--set", "road.pulse_rate=100"], "scan.pulse_rate_khz"),
        (["list", "devicse"], "devices"),
        (["list", "devices", "velodyne-vlp16"], "velodyne-vlp-16"),
        pytest.param(["predict", "segmentation-overhed", "x.laz"], "segmentation-overhead", marks=NEEDS_TORCH),
        (["dataset", "refernce", "-o", "out"], "reference"),
    ],
)
def test_a_slip_of_the_keys_is_answered_by_what_was_meant(
    words: list[str], meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "road.json").write_text(sample_road(RoadScenario(length=100.0), 1).to_json())
    said = refusal(capsys, *words)
    assert said.count("\n") == 1
    assert f"(did you mean '{meant}'?)" in said
    assert "the file" not in said


def test_what_may_be_shortened_or_begins_like_an_option_is_taken() -> None:
    parsed_arguments = parsed("generate", "--out", "x", "--set", "title=--not an option")
    assert (parsed_arguments.output, parsed_arguments.changes) == (Path("x"), ["title=--not an option"])
    assert parsed("cloud", "info", "--", "--strange-name.laz").file == Path("--strange-name.laz")


def takes_numbers(action: argparse.Action) -> bool:
    """Return whether an option's values are numbers, alone or with commas."""
    with suppress(ValueError, TypeError, argparse.ArgumentTypeError):
        return isinstance(action.type, Callable) and action.type("7") in (7.0, (7.0,))
    with suppress(ValueError, TypeError, argparse.ArgumentTypeError):
        return isinstance(action.type, Callable) and action.type("1,2,3") == (1.0, 2.0, 3.0)
    return False


NUMBERS = [
    (name, action.option_strings[-1], action.nargs if isinstance(action.nargs, int) else 1)
    for name, parser in PARSERS.items()
    for action in parser._actions
    if action.option_strings and takes_numbers(action)
]


@pytest.mark.parametrize(("name", "option", "count"), NUMBERS)
def test_negative_numbers_are_values_in_every_notation(
    name: str, option: str, count: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whether an option takes the number is its own affair: none says that the number is missing."""
    for text in ("-1e3", "-1E-3", "-.5", "-5.", "-1,2,3", "-inf"):
        with suppress(SystemExit):
            PARSERS[name].parse_args([option, *[text] * count])
        assert "expected" not in (said := capsys.readouterr().err), said


def test_options_with_negative_numbers_are_found() -> None:
    assert {("cloud crop", "--heights", 2), ("calibrate", "--scanner", 1), ("calibrate", "--line", 1)} <= set(NUMBERS)
    assert parsed("cloud", "crop", "a.laz", "-o", "b.laz", "--heights", "-1e3", "1e3").heights == [-1000.0, 1000.0]
    assert parsed("cloud", "crop", "a.laz", "-o", "b.laz", "--box", "-1e3", "-2.5E2", "-0", "5e2").box[1] == -250.0
