"""`--formats` of the commands that write files: the formats of each, with what they hold and lose."""

from __future__ import annotations

from pathlib import Path

import pytest

from headless import cli
from synthroads_addon.cloud.sweeps.registry import SWEEP_FORMATS
from synthroads_addon.jobs.format_losses import format_losses, format_names
from synthroads_addon.twin.formats import TWIN_FORMATS

Capture = pytest.CaptureFixture[str]


def ended(*words: str) -> int:
    """Return the exit code with which a command ends while its line is read."""
    with pytest.raises(SystemExit) as end:
        cli.main([*words])
    assert isinstance(end.value.code, int)
    return end.value.code


def listed(capsys: Capture, *words: str) -> dict[str, str]:
    """Return the text on each format that a command lists, by name."""
    assert ended(*words) == 0
    found: dict[str, str] = {}
    name = ""
    for line in capsys.readouterr().out.splitlines()[1:-2]:
        name = name if line.startswith(" ") else line.split()[0]
        found[name] = f"{found.get(name, '')} {line}"
    return {key: " ".join(text.split()) for key, text in found.items()}


def test_each_command_lists_what_it_writes(capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    clouds = format_names(["cloud"])
    assert list(listed(capsys, "generate", "--formats")) == format_names()
    assert list(listed(capsys, "scan", "--formats")) == [*clouds, *SWEEP_FORMATS]
    assert list(listed(capsys, "twin", "--formats")) == list(TWIN_FORMATS)
    assert list(listed(capsys, "cloud", "convert", "--formats")) == clouds
    assert not list(tmp_path.iterdir())


def test_what_each_holds_and_loses_is_said(capsys: Capture) -> None:
    found = listed(capsys, "generate", "--formats", "openlabel,usd,pcd")
    assert list(found) == ["openlabel", "usd", "pcd"]
    for name, text in found.items():
        losses = format_losses(name)
        assert losses.file in text
        assert all(part in text for part in losses.loses if len(part) < 30)
        assert " holds " in text
        assert " loses " in text


def test_a_format_that_the_command_does_not_write_is_refused(capsys: Capture) -> None:
    assert ended("twin", "--formats", "laz") == 2
    assert capsys.readouterr().err.startswith("synthroads twin: --formats is 'laz': must be one of cityjson, ")
    assert ended("generate", "--formats", "openlable") == 2
    said = capsys.readouterr().err
    assert "openlabel" in said.partition("did you mean")[2]
    assert said.count("\n") == 1
