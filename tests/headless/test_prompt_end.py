"""A library that works for long without Python doesn't keep a command from ending when a signal comes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals as Unix has them")
ROOT = Path(__file__).parents[2]
HELD = """
import sys; sys.argv = ["-m"]
import argparse, hashlib, pathlib, threading
from headless.commands import leave, run
from headless.prompt_end import ended_promptly
from synthroads_addon.base.files import made_folder
from synthroads_addon.base.scratch.folders import scratch_folder

def work(arguments):
    out = pathlib.Path("out")
    with ended_promptly(), made_folder(out), scratch_folder(out) as folder:
        (folder / "picture.png").write_bytes(b"half")
        threading.Timer(1.0, lambda: print("at work", file=sys.stderr, flush=True)).start()  # by then C is
        hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # some twenty minutes in C
    return 0, {}, ""

leave(lambda: run(work, argparse.Namespace(json=False, quiet=True)))
"""


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_work_that_is_held_by_a_library_ends_with_a_line_and_leaves_nothing(
    sign: signal.Signals, tmp_path: Path
) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    hearing = ["env", "--default-signal=INT,TERM,HUP", sys.executable, "-c", HELD]
    with subprocess.Popen(hearing, env=environment, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        process.send_signal(sign)
        try:
            said = process.communicate(timeout=60)[1]
        finally:
            process.kill()
    assert (process.returncode, said) == (130, "interrupted; nothing was left half-written\n")
    assert list(tmp_path.iterdir()) == []
