"""Caller: warnings at the line that called the package."""

import sys
import warnings


class FewStepsWarning(UserWarning):
    """A stop was touched whose rebounds take few steps, so that the motion may be off by percents."""


def warn(sentence: str, category: type[Warning]) -> None:
    """Warn at the line of the caller outside the package."""
    level, caller = 1, sys._getframe()
    while caller.f_back is not None and _ours(caller.f_globals.get("__name__", "")):
        level, caller = level + 1, caller.f_back
    warnings.warn(sentence, category, stacklevel=level)


def _ours(module: str) -> bool:
    """Whether a module belongs to the package or to the libraries that call it."""
    return module.partition(".")[0] in ("jaxrotor", "equinox", "jaxtyping", "beartype")
