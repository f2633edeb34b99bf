"""Checks: whole numbers within their range, and what a misspelt name may have meant."""

import difflib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np


def is_whole(value: Any, least: int) -> bool:
    """Whether a value is a whole number of at least `least`; a truth value is none."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    return whole and bool(value >= least)


def check_counts(least: int = 1, /, **counts: Any) -> None:
    """Raise unless every count, named by its keyword, is a whole number of at least `least`."""
    for name, value in counts.items():
        if not is_whole(value, least):
            raise ValueError(
                f"`{name}` must be a whole number of at least {least}, but is {value!r}."
            )


def suggest(word: str, words: Sequence[str] | Mapping[str, Any], called: Callable = str) -> str:
    """A closing hint, " (did you mean `..`?)", or nothing; `called` gives what to write for a word."""
    close = difflib.get_close_matches(word, list(words), n=1)
    return f" (did you mean `{called(close[0])}`?)" if close else ""
