"""Typed: messages of the library, reworded for the command line."""

import functools
import re
from collections.abc import Sequence
from typing import Any


# Commands for functions of the library whose name differs.
_COMMANDS = {
    "critical_speeds": "critical {scene}",
    "floquet_multipliers": "stability {scene} --over spin.speed=0:6000rpm:61",
    "growth_rate": "stability {scene} --over spin.speed=0:6000rpm:61",
    "onset_speed": "onset {scene}",
    "stability_crossings": "stability {scene} --over spin.speed=0:6000rpm:61",
    "unbalance_response": "response {scene}",
}
_OPTIONS = {"steps_per_revolution": ("steps",), "within": ("low", "high"), "times": ("duration",)}


def typed(sentence: str, name: str, words: Sequence[str], commands: Sequence[str], own: Any) -> str:
    """A message of the library, reworded for someone at a prompt.

    Functions become commands on the same scene, arguments become options of this command, and parts of a
    scene become tables of its file. Functions without a command are marked as Python.

    Args:
        sentence: message of an error.
        name: name of the command that failed.
        words: arguments typed after the name.
        commands: names of all commands.
        own: the command itself; its parameters have the names of its options.

    Returns:
        The message.
    """
    scene = words[0] if words and not words[0].startswith("-") else "SCENE"

    def function(found: re.Match[str]) -> str:
        called = found[1].replace("_", "-")
        if found[1] in _COMMANDS:
            return f"`jaxrotor {_COMMANDS[found[1]].format(scene=scene)}`"
        if called in commands and called != name:
            return f"`jaxrotor {called} {scene}`"
        return f"{found[0]} in Python"

    options = {param.name: param.opts[0] for param in own.params if param.opts[0].startswith("-")}

    def argument(found: re.Match[str]) -> str:
        meant = [options.get(one) for one in _OPTIONS.get(found[1], (found[1],))]
        return found[0] if None in meant else " and ".join(filter(None, meant))

    sentence = re.sub(r"`jaxrotor\.([a-z_]+)`", function, sentence)
    sentence = re.sub(r"`([a-z_]+)`", argument, sentence)
    if "solver" in options:
        located = "`solver=Exponential(4, located=True)`"
        sentence = sentence.replace(located, "--solver exponential4-located")
    sentence = re.sub(
        r"`scene\.without\(['\"](\w+)['\"]\)`", r"a scene file without its \1", sentence
    )
    constant = "a scene file whose [spin] is a constant speed"
    sentence = sentence.replace("`scene.at_speed(..)`", constant)
    return re.sub(r"\b[A-Z]\w+", lambda found: _tables().get(found[0], found[0]), sentence)


@functools.cache
def _tables() -> dict[str, str]:
    """Tables of a scene file, by the name of the class of each."""
    from .. import effects

    found = (cls for cls in vars(effects).values() if hasattr(cls, "kind"))
    return {cls.__name__: f"[{cls.kind}]" for cls in found}
