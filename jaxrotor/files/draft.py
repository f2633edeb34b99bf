"""Draft of a file, which replaces the file only when it is complete."""

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from .units import refuse


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield the path of a draft in the same folder, which replaces `target` at the end.

    If writing fails, the draft is deleted and `target` stays as it was.
    """
    draft = target.with_name(f".{secrets.token_hex(8)}{target.suffix}")
    try:
        yield draft
        os.replace(draft, target)
    except OSError as error:
        reason = error.strerror or error
        refuse(f"{target}", f"cannot be written ({reason}); choose another place.")
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()
