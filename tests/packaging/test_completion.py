"""Completion in shells, by the shells themselves; of one that isn't here only that its script has every command."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from headless.cli import COMMANDS, main

ROOT = Path(__file__).resolve().parents[2]
BASH = shutil.which("bash")
FISH = shutil.which("fish")
ZSH = shutil.which("zsh")
ASKED = r"""
source "$1"; shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
function_name=$(complete -p synthroads | sed 's/.*-F \([^ ]*\).*/\1/')
"$function_name" synthroads "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
printf '%s\n' "${COMPREPLY[@]}"
"""
"""Imitation of bash when the key is pressed: sets these variables, calls the function, offers what it leaves."""
FILES = ("mine.json", "scene.glb", "recipe.yaml", "clouds")
CASES = {
    "gen": {"generate"},
    "re": {"reconstruct"},
    "ro": {"road"},
    "generate --fi": {"--fidelity"},
    "generate -": {"-o", "--output", "-s", "--seed", "-v", "--verbose", "--json", "-h", "--help"},
    "generate --fidelity ": {"draft", "standard", "high"},
    "generate -f d": {"draft"},
    "generate --output out --scenario rq": {"rq31-600m", "rq31-600m-even"},
    "generate --scenario m": {"mobile-mapping-300m", "mobile-mapping-300m-even", "mine.json"},
    "generate --parameters mi": {"mine.json"},
    "generate -o cl": {"clouds"},
    "generate -o mi": set(),
    "scan sc": {"scene.glb"},
    "scan scene.glb -d velodyne-hdl": {"velodyne-hdl-32e", "velodyne-hdl-64e"},
    "dataset re": {"reference", "recipe.yaml"},
    "train centerline-s": {"centerline-sequence", "centerline-single"},
    "cloud ": {"info", "subsample", "map-intensity", "convert", "preview", "merge", "crop", "tile"},
    "cloud convert mine --classes 1": {"17", "19"},
    "tradeoff --knobs fid": {"fidelity"},
    "twin mine.json --twin opend": {"opendrive"},
    "parameters --cross-section RQ4": {"RQ43.5"},
    "--print-completion ": {"bash", "fish", "zsh"},
}
"""Words typed after `synthroads`, and what is offered: all of it, but for an option's bare dash."""


ENDS = {"gen": "erate", "generate --fi": "delity", "generate -f d": "raft", "generate --scenario min": "e.json"}
ENDS |= {"generate -o cl": "ouds", "dataset ref": "erence", "scan x -d velodyne-v": "lp-16", "cloud conv": "ert"}
"""Beginnings that are typed, and what is put behind them as it alone fits."""


def script(shell: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Return a file with the script for a shell, beside files to be completed."""
    with pytest.raises(SystemExit) as ended:
        main(["--print-completion", shell])
    assert ended.value.code == 0
    (folder / "home").mkdir()
    (folder / "home" / "clouds").mkdir()
    for name in FILES[:-1]:
        (folder / "home" / name).touch()
    text = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in text] == []
    path = folder / f"synthroads.{shell}"
    path.write_text(text)
    return path


def check(typed: str, offered: set[str]) -> None:
    wanted = CASES[typed]
    assert offered >= wanted, typed
    assert offered == wanted or typed.endswith(" -"), typed


def test_bash_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = script("bash", tmp_path, capsys)
    for typed in CASES if BASH else ():
        line = [str(BASH), "--norc", "-c", ASKED, "bash", str(path), "synthroads", *typed.split(" ")]
        done = subprocess.run(line, cwd=tmp_path / "home", capture_output=True, text=True, check=True)
        assert done.stderr == ""
        check(typed, set(done.stdout.split()))


def test_fish_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = script("fish", tmp_path, capsys)
    for typed in CASES if FISH else ():
        line = [str(FISH), "--no-config", "-c", f"source {path}; complete -C 'synthroads {typed}'"]
        done = subprocess.run(line, cwd=tmp_path / "home", capture_output=True, text=True, check=True)
        assert done.stderr == ""
        check(typed, {each.split("\t")[0].rstrip("/") for each in done.stdout.splitlines()})


def test_zsh_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a terminal, as it completes nowhere else; where one word alone fits, it stands there."""
    path = script("zsh", tmp_path, capsys)
    if ZSH is None:
        return
    ours, theirs = os.openpty()
    options = {"stdin": theirs, "stdout": theirs, "stderr": theirs, "start_new_session": True}
    environment = {**os.environ, "TERM": "dumb", "HOME": str(tmp_path)}
    with subprocess.Popen([str(ZSH), "-f", "-i"], cwd=tmp_path / "home", env=environment, **options) as process:
        setting_up = f"PS1=; autoload -Uz compinit; compinit -D -u; eval \"$(cat {path})\"; echo rea''dy\n"
        assert "ready" in answer(ours, setting_up, "ready")
        for typed, end in ENDS.items():
            line = f"synthroads {typed}{end}"
            assert line in answer(ours, f"synthroads {typed}\t", line), typed
            os.write(ours, b"\x15")  # Ctrl-U
        process.kill()
    os.close(ours)
    os.close(theirs)


def answer(terminal: int, typed: str, wanted: str) -> str:
    """Type something and return what the terminal shows, once it shows what is wanted, or after a while."""
    os.write(terminal, typed.encode())
    shown, deadline = "", time.monotonic() + 30.0
    while wanted not in shown and time.monotonic() < deadline:
        if select.select([terminal], [], [], 0.2)[0]:
            shown += os.read(terminal, 65536).decode(errors="replace")
    return shown


def test_without_the_package_it_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as ended:
        main(["--print-completion", "bash"])
    assert ended.value.code == 2
    wanted = "error: the package shtab is missing: run pip install 'synthroads[blender]'\n"
    assert capsys.readouterr() == ("", wanted)
