"""Interrupt: Ctrl-C ends a command whatever the program is doing when it comes."""

import signal
import sys
import threading
from typing import Any


LATER = 0.05  # [s]


def stop_on_ctrl_c() -> None:
    """Raise `KeyboardInterrupt` once more where Python cannot pass it on.

    Python prints an exception that is raised while memory is being freed (in a function called at every
    garbage collection, of which jax has one, in a weak reference or in `__del__`) and goes on, so that
    a Ctrl-C at that moment would not end the command. However many are lost in the meantime, it is
    raised once.
    """
    before = sys.unraisablehook
    pending = threading.Event()

    def hook(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            before(unraisable)
        elif not pending.is_set():
            pending.set()
            again = threading.Timer(LATER, interrupt)
            again.daemon = True
            again.start()

    def interrupt() -> None:
        pending.clear()
        _interrupt()

    sys.unraisablehook = hook


def _interrupt() -> None:
    """Ctrl-C once more, and so that a main thread that waits wakes up."""
    if hasattr(signal, "pthread_kill") and (main := threading.main_thread().ident) is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)
