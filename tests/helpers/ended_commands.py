"""Commands that are ended in the middle, by each signal: what they say, and what they and the next run leave."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
START = "import sys; sys.argv[0] = 'synthroads'; from headless.cli import console; console()"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
WORKER = "worker"
"""In place of a signal: SIGKILL to the process in which a command's work is done, as the system sends it."""
_TRIES = 6
"""Runs for each end; the later ones are sent their signal earlier, as the machine may have become faster."""


@dataclass(frozen=True)
class Ended:
    """End of a command: exit code, and what it said on standard error."""

    code: int
    said: str
    seconds: float


def run_until(arguments: Sequence[str], after: float, sign: signal.Signals | str | None) -> Ended:
    """Run a command and send it a signal after some seconds, or none; return how it ended."""
    hearing = ["env", "--default-signal=INT,HUP", *arguments]  # a shell's background jobs are deaf to interrupts
    begun = time.monotonic()
    with subprocess.Popen(hearing, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        if sign is not None:
            time.sleep(after)
            _send(process, sign)
        _, said = process.communicate(timeout=900)
    return Ended(process.returncode, said, time.monotonic() - begun)


def _send(process: subprocess.Popen[str], sign: signal.Signals | str) -> None:
    if isinstance(sign, signal.Signals):
        process.send_signal(sign)
        return
    with suppress(OSError):  # it has ended
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for child in children[:1]:
            os.kill(int(child), signal.SIGKILL)


def processes_of(folder: Path) -> list[str]:
    """Return the commands of all processes that have a folder, or one in it, for their temporary files."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if os.fsencode(f"TMPDIR={folder}") in (path / "environ").read_bytes() and path.name != str(os.getpid()):
                found.append((path / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
    return [command for command in found if command]  # one that has ended has no words any more


@dataclass
class EndedTool:
    """A tool whose runs are ended in the middle.

    Attributes:
        words: its command, without what is to become of files that are there.
        out: the folder that it makes.
        temporary: folder for temporary files, the tool's alone.
        again: words of a run where there may be files already.
        timed: names of files, or their ends, that differ from run to run, as they hold times.
        resumes: whether it goes on with what is there; its files may then differ until all of it is done.
        ended: ends -> how many came in the middle.
        finished: whether the last run came to its end.
        lying: hidden folders that lie there since a SIGKILL, as no run has come so far yet that it removes them.
    """

    words: Sequence[str]
    out: Path
    temporary: Path
    again: Sequence[str] = ("--overwrite",)
    timed: tuple[str, ...] = ()
    resumes: bool = False
    ended: Counter[str] = field(default_factory=Counter)
    finished: bool = True
    lying: set[str] = field(default_factory=set)

    def run(self, after: float = 0.0, sign: signal.Signals | str | None = None) -> Ended:
        """Run it as one that may find files."""
        return run_until([sys.executable, "-c", START, *self.words, "--quiet", *self.again], after, sign)

    def files(self) -> dict[str, bytes]:
        """Return the files that stand in its folder; those that hold times are empty."""
        there = [path for path in sorted(self.out.rglob("*")) if path.is_file()]
        return {
            path.relative_to(self.out).as_posix(): b"" if path.name.endswith(self.timed or "\0") else path.read_bytes()
            for path in there
        }

    def end_in_the_middle(self, ends: Sequence[signal.Signals | str], seed: str) -> None:
        """End runs of it at moments drawn over its time, until each end came once in the middle; see to what is left.

        After each: a line at most; no file half-written; none that is hidden, and no temporary ones, but those of a
        SIGKILL before the next run has come so far that it removes them; no process. After the next run: the files of
        an undisturbed one, and nothing else.
        """
        whole = self.run()
        assert whole.code in (0, 3), whole.said
        wanted, seconds = self.files(), whole.seconds
        assert wanted
        draw = random.Random(seed)
        for sign in ends:
            self._begin_anew()
            name = sign.name if isinstance(sign, signal.Signals) else sign
            for _ in range(_TRIES):
                ended = self.run(draw.uniform(0.2, 0.9) * seconds, sign)
                self._check(ended, sign, wanted)
                if ended.code not in (0, 3):
                    self.ended[name] += 1
                    break
                self._begin_anew()
                seconds *= 0.8
        again = self.run()
        assert again.code in (0, 3), again.said
        assert self.files() == wanted
        assert list(self.temporary.iterdir()) == []
        assert sum(self.ended.values()) == len(ends), self.ended

    def _begin_anew(self) -> None:
        """Remove what one that goes on has finished: it would have nothing to do."""
        if self.resumes and self.finished:
            shutil.rmtree(self.out)
        self.finished = False

    def _check(self, ended: Ended, sign: signal.Signals | str, wanted: dict[str, bytes]) -> None:
        about = (sign, ended)
        killed = sign == signal.SIGKILL
        assert ended.code in (0, 3, 2 if sign == WORKER else -sign if killed else 130), about
        assert "Traceback" not in ended.said, about
        lines = ended.said.splitlines()
        notes = [line for line in lines if self.resumes and line.startswith("what is trained and tested is kept in")]
        assert len(lines) <= 1 + len(notes) <= 2, about
        assert _none_left(self.temporary), (about, processes_of(self.temporary))
        self.finished = ended.code in (0, 3)
        there = self.files()
        hidden = {name for name in there if any(part.startswith(".") for part in Path(name).parts)}
        lying = {name.partition("/")[0] for name in hidden} | {path.name for path in self.temporary.iterdir()}
        # The worker of one that goes on holds a training's lock, which the next run takes over.
        assert killed or (sign == WORKER and self.resumes) or lying <= self.lying, (about, lying)
        self.lying = lying
        for name in there.keys() - hidden:
            if self.resumes:
                assert not name.endswith(".json") or json.loads((self.out / name).read_text()) is not None, about
            else:
                assert there[name] == wanted.get(name), (about, name)


def _none_left(folder: Path, seconds: float = 60.0) -> bool:
    """Wait until no process has a folder for its temporary files; return whether that came."""
    until = time.monotonic() + seconds
    while processes_of(folder):
        if time.monotonic() > until:
            return False
        time.sleep(0.1)
    return True


@contextmanager
def unchanged(folder: Path) -> Iterator[None]:
    """Context at whose end a folder must hold the files that it holds now, and no others."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    yield
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()} == before
