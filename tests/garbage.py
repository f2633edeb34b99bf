"""Garbage in tests and in the processes they start: tracing makes millions of objects that stay.

Searching them all for garbage is a tenth of the time.
"""

import gc


THRESHOLDS = 400_000, 20, 50
CODE = f"import gc; gc.freeze(); gc.set_threshold{THRESHOLDS}"  # for another process


def collect_rarely() -> None:
    """Leave the objects there are out of every search, and search less often."""
    gc.freeze()
    gc.set_threshold(*THRESHOLDS)
