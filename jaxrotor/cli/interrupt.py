"""Interrupt: Ctrl-C ends a command whatever the program is doing."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any


LATER = 0.05  # delay before the interrupt is raised a second time [s]
INTERRUPTED = 130  # exit status of a command that Ctrl-C has ended


def run_until_interrupted(program: Callable[[], None]) -> None:
    """Run a program that ends by `SystemExit`, after Ctrl-C without waiting for threads under way."""
    try:
        program()
    except SystemExit as end:
        main = threading.main_thread()
        waited_for = [one for one in threading.enumerate() if one is not main and not one.daemon]
        if end.code == INTERRUPTED and waited_for:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise


def stop_on_ctrl_c() -> None:
    """Raise `KeyboardInterrupt` a second time where Python cannot propagate it.

    Python only prints an exception raised while memory is freed: in a callback of the garbage collector,
    such as that of jax, in a weak reference or in `__del__`. A Ctrl-C at that moment would be lost.
    However many are lost before the delay is over, one is raised.
    """
    before = sys.unraisablehook
    pending = threading.Event()

    def hook(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            before(unraisable)
        elif not pending.is_set():
            pending.set()
            timer = threading.Timer(LATER, interrupt)
            timer.daemon = True
            timer.start()

    def interrupt() -> None:
        pending.clear()
        _interrupt()

    sys.unraisablehook = hook


def _interrupt() -> None:
    """Send Ctrl-C to the main thread, so that it wakes up if it waits."""
    if hasattr(signal, "pthread_kill") and (main := threading.main_thread().ident) is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
