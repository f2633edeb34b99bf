"""Checks of whole numbers and of order, and suggestions for misspelt names."""

import difflib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np


def is_whole(value: Any, least: int) -> bool:
    """Whether `value` is an integer of at least `least`; True and False are not integers here."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    return whole and bool(value >= least)


def check_counts(least: int = 1, /, **counts: Any) -> None:
    """Raise unless every count is a whole number of at least `least`; keywords name the counts."""
    for name, value in counts.items():
        if not is_whole(value, least):
            raise ValueError(
                f"`{name}` must be a whole number of at least {least}, but is {value!r}."
            )


def in_order(values: np.ndarray) -> bool:
    """Whether values ascend or descend throughout."""
    steps = np.diff(values)
    return bool(np.all(steps > 0) or np.all(steps < 0))


def suggest(word: str, words: Sequence[str] | Mapping[str, Any], called: Callable = str) -> str:
    """A hint `(did you mean ..?)`, empty if no word is close; `called` maps a word to the text shown."""
    close = difflib.get_close_matches(word, list(words), n=1)
    return f" (did you mean `{called(close[0])}`?)" if close else ""


def check_kind(value: Any, kind: type, what: str, wanted: str) -> None:
    """Raise unless a value is of a kind."""
    if not isinstance(value, kind):
        raise ValueError(f"{what} must be {wanted}, but is {value!r}.")


def check_invariants(module: Any, path: str) -> None:
    """Check conditions on several fields of a module, as when it is built."""
    try:
        getattr(module, "__check_init__", tuple)()
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
