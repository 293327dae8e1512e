"""Work that libraries do for long without Python, as renders: a signal ends the command all the same, without delay."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from headless.commands import report_interrupt
from synthroads_addon.base.process.end_signals import ENDS, ignore_end_signals
from synthroads_addon.base.scratch.folders import remove_scratch_folders

GRACE = 1.0
"""Seconds in which the main thread may end the work by itself, as it does unless a library holds it."""


@contextmanager
def ended_promptly() -> Iterator[None]:
    """Context in which a signal ends the process within `GRACE`, whatever the main thread does; Unix alone.

    Files must appear under their names only when they are whole, and no process of ours be at work.
    """
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        yield
        return
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    is_over = threading.Event()
    former_descriptor = signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    threading.Thread(target=_wait_for_signal, args=(read_end, is_over), daemon=True).start()
    try:
        yield
    finally:
        is_over.set()
        signal.set_wakeup_fd(former_descriptor)
        os.close(write_end)  # the thread ends with the pipe


def _wait_for_signal(read_end: int, is_over: threading.Event) -> None:
    """End the process if a signal comes that ends it and the work isn't over a while later."""
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)  # the main thread is to hear them
    while signal_byte := os.read(read_end, 1):
        is_end = signal_byte[0] in ENDS and signal.getsignal(signal_byte[0]) not in (signal.SIG_IGN, signal.SIG_DFL)
        if is_end and not is_over.wait(GRACE):
            _leave()
    os.close(read_end)


def _leave() -> None:
    """Clean up and end the process with exit code 130."""
    ignore_end_signals()
    code = report_interrupt()
    remove_scratch_folders()
    os._exit(code)
