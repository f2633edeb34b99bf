"""Command `scenes`: list of the shipped scenes."""

from ..files.shipped import shipped
from . import answer
from .answer import AsJson


def scenes(as_json: AsJson = False) -> None:
    """List the scenes that come with jaxrotor."""
    found = shipped()
    facts = {"scenes": [{"name": name, "title": title} for name, title in found]}
    answer.give(as_json, facts, answer.Table(found, ("scene", "title")))
