"""Commands run in this process on files made wrong by chance: what each may say, take and leave; figures of each."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import strategies as st

from headless.cli import main
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud
from tests.helpers.files.command_figures import Figures
from tests.helpers.files.mutations import FUZZ_CASES, cases, for_all, limited
from tests.helpers.process_memory import memory_mb, reset_peak

SECONDS = 60.0
"""Of the processor that a command may take."""
MOST_MB = 4096.0
"""Memory that a command may take beyond what the process has already."""
OUT = "{out}"
"""In a command's words: the folder of its output, which isn't there before."""
IN = "{in}"
"""In a command's words: the folder of its inputs."""
USUAL = 10_000
"""Cases of all commands together by `make fuzz`, unless the environment's FUZZ_CASES is another number."""
Case = tuple[Sequence[str], Mapping[str, bytes]]
"""A command's words, and what stands in the place of sound inputs, by name in their folder."""


def fuzz_commands(few: int, many: int) -> pytest.MarkDecorator:
    """Return the mark that runs a test with an argument ``count`` on few cases, and by `make fuzz` on many.

    Args:
        few: cases with the fast tests.
        many: of the `USUAL` ones of all commands together.
    """
    return cases(few, max(1, round(many * FUZZ_CASES / USUAL)), pytest.mark.fuzz)


@dataclass
class Workplace:
    """Folder of sound inputs, in which commands are run on wrong ones.

    Attributes:
        folder: holds ``in`` with the inputs, ``out`` for the output and ``tmp`` for temporary files.
        capsys: what the command prints.
        figures: of the cases that were run.
        writes: whether the command writes files where it takes its inputs.
        resumes: folder of the inputs that is copied to the output before each command, which goes on in it.
    """

    folder: Path
    capsys: pytest.CaptureFixture[str]
    figures: Figures
    writes: bool = True
    resumes: str = ""

    @property
    def inputs(self) -> Path:
        """Folder of the inputs."""
        return self.folder / "in"

    def run_all(self, strategy: st.SearchStrategy[Case], count: int) -> None:
        """Run a number of cases."""
        for_all(strategy, count, self.run)

    def run(self, case: Case) -> int:
        """Run a command on files made wrong, see how it ends and what it leaves; return the exit code."""
        words, wrong = case
        with self._with(wrong):
            before = _stamps(self.inputs)
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            if self.resumes:
                shutil.copytree(self.inputs / self.resumes, self.folder / "out" / self.resumes)
            there = _contents(self.folder / "out")
            filled = [
                word.replace(IN, str(self.inputs)).replace(OUT, str(self.folder / "out"))
                for word in (*words, "--quiet")
            ]
            code = self._measured(filled)
            assert _stamps(self.inputs) == before, "inputs were changed, or something was put beside them"
            assert code != 2 or _contents(self.folder / "out") == there, "refused, and changed the output"
        self._check_left(code)
        return code

    @contextmanager
    def _with(self, wrong: Mapping[str, bytes]) -> Iterator[None]:
        """Context in which inputs have other contents."""
        sound = {name: (self.inputs / name).read_bytes() for name in wrong if (self.inputs / name).exists()}
        for name, content in wrong.items():
            (self.inputs / name).write_bytes(content)
        try:
            yield
        finally:
            for name in wrong:
                if name in sound:
                    (self.inputs / name).write_bytes(sound[name])
                else:
                    (self.inputs / name).unlink()

    def _measured(self, words: Sequence[str]) -> int:
        """Run a command within its limits; return its exit code."""
        self.capsys.readouterr()
        reset_peak()
        taken, begun = memory_mb(), time.process_time()
        with limited(SECONDS):
            try:
                code = main(words)
            except SystemExit as error:  # words that the command's parser refuses
                code = error.code if isinstance(error.code, int) else 1
        seconds, memory = time.process_time() - begun, memory_mb("VmHWM") - taken
        self.figures.add(code, seconds, memory)
        said = self.capsys.readouterr().err
        assert code in (0, 2, 3), f"{code}: {said}"
        lines = said.splitlines()
        assert len(lines) == (code == 2), said
        if lines:
            assert "error: " in lines[0] or lines[0].startswith("synthroads "), said
            assert "too little memory" not in said, said
            assert len(said) < 2000, said
        assert seconds < SECONDS
        assert memory < MOST_MB
        return code

    def _check_left(self, code: int) -> None:
        """See that temporary files are gone, that nothing half-written stands, and what was written can be read."""
        out = self.folder / "out"
        left = list((self.folder / "tmp").rglob("*"))
        assert not left, left
        files = list(out.rglob("*"))
        hidden = [path for path in files if path.name.startswith(".")]
        assert not hidden, hidden
        assert code == 2 or files or not self.writes, "nothing was written"
        for path in files if code != 2 else ():
            check_readable(path)


def check_readable(path: Path) -> None:
    """See that a file which a command has written is whole."""
    if path.suffix in (".json", ".geojson"):
        json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number)
    elif path.suffix in ENDINGS:
        with open_cloud(path) as cloud:
            assert sum(len(block) for block in cloud.blocks()) == cloud.header.count
    elif path.suffix == ".png":
        assert path.read_bytes()[-8:-4] == b"IEND", path


def _no_number(text: str) -> None:
    pytest.fail(f"{text} in JSON")


def _contents(folder: Path) -> dict[str, int | None]:
    """Return the checksums of all files below a folder, and None for folders."""
    paths = [folder, *folder.rglob("*")] if folder.exists() else []
    return {str(path): crc32(path.read_bytes()) if path.is_file() else None for path in paths}


def _stamps(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return kind, size and time of change of all that is below a folder: files that were written have another time."""
    found, folders = {}, [str(folder)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                told = entry.stat(follow_symlinks=False)
                inner = [entry.path] if entry.is_dir(follow_symlinks=False) else []
                found[entry.path] = (told.st_mode, 0, 0) if inner else (told.st_mode, told.st_size, told.st_mtime_ns)
                folders += inner
    return found


def wrong_file(words: Sequence[str], name: str, contents: st.SearchStrategy[bytes]) -> st.SearchStrategy[Case]:
    """Return cases of a command one of whose inputs is made wrong."""
    return contents.map(lambda content: (words, {name: content}))


def wrong_words(words: Sequence[str], more: Sequence[Sequence[str]]) -> st.SearchStrategy[Case]:
    """Return cases of a command with further words."""
    return st.sampled_from([(*words, *each) for each in more]).map(lambda each: (each, {}))


MakeWorkplace = Callable[..., Workplace]
"""Makes a workplace of a folder of inputs for a target of that name, and reports its figures at the end."""
