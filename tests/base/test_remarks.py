"""Warnings and assumptions: told once, and assumptions only of work that succeeds."""

import argparse
import threading

import pytest

from headless.messages import messages
from synthroads_addon.base.remarks import assume, collected_remarks, remarks_so_far, warn


def arguments(quiet: bool = False) -> argparse.Namespace:
    return argparse.Namespace(quiet=quiet, verbose=False, json=False)


def test_a_command_tells_each_once_and_assumptions_last(capsys: pytest.CaptureFixture[str]) -> None:
    with messages(arguments()):
        assume("%s names no system", "axis.csv")
        for _ in range(2):
            warn("%s is in feet", "cloud.laz")
        assume("%s names no system", "axis.csv")
    assert capsys.readouterr().err == "cloud.laz is in feet\naxis.csv names no system\n"


def test_nothing_is_assumed_in_work_that_fails(capsys: pytest.CaptureFixture[str]) -> None:

    def fail() -> None:
        with messages(arguments()):
            assume("axis.csv names no system")
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fail()
    assert capsys.readouterr().err == ""


def test_quiet_commands_tell_neither(capsys: pytest.CaptureFixture[str]) -> None:
    with messages(arguments(quiet=True)):
        assume("axis.csv names no system")
        warn("cloud.laz is in feet")
    assert capsys.readouterr().err == ""


def test_the_panel_collects_what_threads_tell() -> None:
    with collected_remarks() as remarks:
        assume("first")
        thread = threading.Thread(target=warn, args=("second",))
        thread.start()
        thread.join()
        warn("second")
    warn("after the end")
    assert remarks == ["first", "second"]


def test_quiet_commands_collect_what_they_dont_tell(capsys: pytest.CaptureFixture[str]) -> None:
    with messages(arguments(quiet=True)), collected_remarks() as remarks:
        assume("%s names no system", "axis.csv")
        warn("100 % is in feet")
    assert remarks == ["axis.csv names no system", "100 % is in feet"]
    assert capsys.readouterr().err == ""


def test_work_within_other_work_has_its_own_remarks() -> None:
    assert remarks_so_far() == []
    with collected_remarks():
        warn("of all work")
        with collected_remarks() as inner:
            warn("of a part of it")
            assert remarks_so_far() == inner == ["of a part of it"]
        assert remarks_so_far() == ["of all work", "of a part of it"]
    assert remarks_so_far() == []
