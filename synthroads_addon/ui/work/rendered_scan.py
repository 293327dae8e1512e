"""Scans that need rendering, by a second Blender on a copy of the open file, so that the window stays responsive."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError, OutputError
from ...base.remarks import warn
from ...blender.files import save_scene
from ...scenario.scenario import Scenario
from .background_scan import MARK
from .job import Report

_TICK = 0.1
"""Seconds between two looks at the other Blender: it is ended so long after the user cancelled."""
_JOB, _LINES, _ERRORS = "job.json", "lines.txt", "errors.txt"


@dataclass(frozen=True)
class Scanned:
    """Result of the second Blender's scan.

    Attributes:
        counts: as JSON data.
        stages: timed, see `StageTimer`.
        warnings: of the scene.
        remarks: what users must know of the input, see `base.remarks`; told in this Blender too.
    """

    counts: dict[str, Any]
    stages: dict[str, Any]
    warnings: list[str]
    remarks: list[str]


@dataclass(frozen=True)
class SavedScene:
    """Copy of the open file with the scan to do on it, in a folder of its own.

    Attributes:
        place: the folder; `scan` removes it.
        command: what runs the other Blender.
    """

    place: Path
    command: tuple[str, ...]

    def scan(self, report: Report) -> Scanned:
        """Scan the copy by a second Blender into the folder that holds `place`: cloud and previews; for any thread.

        Raises:
            InputError: that of the other Blender; or it can't be started, or was ended by someone else.
            Cancelled: by `report`; the other Blender is ended.
            RuntimeError: a defect in the other Blender.
        """
        messages = _Messages()
        try:
            with self._process() as process:
                self._watch(process, messages, report)
            scanned = self._result(process.returncode, messages)
        finally:
            shutil.rmtree(self.place, ignore_errors=True)
        for remark in scanned.remarks:
            warn("%s", remark)
        return scanned

    @contextmanager
    def _process(self) -> Iterator[subprocess.Popen[bytes]]:
        """Context of the second Blender's process, which is ended on exit whatever happens."""
        # What a Blender that is killed leaves behind is removed with the folder.
        environment = os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.place))
        with (self.place / _LINES).open("wb") as lines, (self.place / _ERRORS).open("wb") as errors:
            try:
                process = subprocess.Popen(
                    self.command,
                    stdin=subprocess.PIPE,  # closes, and so ends it, if this process ends in any way
                    stdout=lines,
                    stderr=errors,
                    env=environment,
                    creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                )
            except OSError as error:
                reason = f"can't be started in the background ({error.strerror})"
                raise InputError("Blender", self.command[0], reason) from None
            with process:
                try:
                    yield process
                finally:
                    process.kill()

    def _watch(self, process: subprocess.Popen[bytes], messages: _Messages, report: Report) -> None:
        """Report the second Blender's progress until it ends."""
        with (self.place / _LINES).open(encoding="utf-8", errors="replace") as lines:
            ended = False
            while not ended:
                # Asked before reading: its last lines are read as well.
                ended = process.poll() is not None
                messages.update(lines.read())
                report(messages.share)
                if not ended:
                    _wait(process)

    def _result(self, code: int, messages: _Messages) -> Scanned:
        if messages.error is not None:
            raise InputError(messages.error[0], None, messages.error[1])
        if messages.done is not None:
            return Scanned(**messages.done)
        if code < 0:
            raise InputError("Blender", None, f"was ended by signal {-code} (too little memory?)")
        errors = (self.place / _ERRORS).read_text(encoding="utf-8", errors="replace").strip()
        raise RuntimeError(f"Blender in the background ended with exit code {code}: {errors or 'no message'}")


@dataclass
class _Messages:
    """Messages of the second Blender so far.

    Attributes:
        share: of the scan that is done.
        error: head and rest of the message that its input is wrong; None if it isn't.
        done: counts and stages; None before the end.
    """

    share: float = 0.0
    error: tuple[str, str] | None = None
    done: dict[str, Any] | None = None
    _rest: str = field(default="", repr=False)

    def update(self, text: str) -> None:
        """Update progress and result from new output: marked lines are JSON, Blender's own lines are left out."""
        *lines, self._rest = (self._rest + text).split("\n")
        for line in lines:
            # Blender may have left a line of its own unfinished.
            _, mark, data = line.partition(MARK)
            for name, value in json.loads(data).items() if mark else ():
                setattr(self, name, value)


def _wait(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(_TICK)
    except subprocess.TimeoutExpired:
        return


def save_open_scene(scenario: Scenario, folder: Path, scanned: Mapping[str, Any]) -> SavedScene:
    """Save a copy of the open file for a scan by a second Blender; the open file keeps its name and state.

    Args:
        scenario: what is scanned and rendered, and how.
        folder: where the scan's files go; the copy is in a folder inside until it is scanned.
        scanned: what is scanned, as JSON data: a road's ``parameters`` and its id ``road``; or, without a road, the
            ``route``, the ``classes`` by name, and whose state of the scene is ``visible``.

    Raises:
        OutputError: the copy can't be written.
    """
    place = folder / "background"
    place.mkdir()
    copy = place / "scene.blend"
    try:
        save_scene(copy, compress=False)
    except RuntimeError as error:
        reason = f"cannot be written ({' '.join(str(error).split())})"
        raise OutputError("--output", str(folder.parent), reason) from None
    job = {
        "file": str(copy.resolve()),
        "folder": str(folder.resolve()),
        "scene": bpy.context.scene.name,
        "view_layer": bpy.context.view_layer.name,
        # The copy lies elsewhere than what the user trusts: its scripts run if those of the open file do.
        "scripts": not bpy.app.autoexec_fail,
        "scenario": json.loads(scenario.to_json()),
        **scanned,
    }
    path = (place / _JOB).resolve()
    path.write_text(json.dumps(job), encoding="utf-8")
    return SavedScene(place, _command(path))


def _command(job: Path) -> tuple[str, ...]:
    """Return the command line that runs `background_scan` in a second Blender of this version.

    It finds the add-on, and the packages that it needs, where this one did, whether it is enabled there or not.
    """
    places = [os.path.abspath(place) for place in sys.path]  # noqa: PTH100 - "" is the working directory
    module = f"{__package__}.background_scan"
    lines = f"import sys; sys.path += [p for p in {places!r} if p not in sys.path]; "
    lines += f"from importlib import import_module; import_module({module!r}).main({str(job)!r})"
    if bpy.app.binary_path:
        return (bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python-expr", lines)
    return (sys.executable, "-c", lines)
