"""Long description of the package, as an index of packages shows it: the README without relative links."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface


LINK = re.compile(r"(!?)\[((?:[^][]|\[[^][]*\])*)\]\((?![a-z]+:|#)([^)\s]+)\)")
INSTALLED = ("pip install -e . ", "pip install jaxrotor "), ("`.[cuda]`", "`jaxrotor[cuda]`")
COMMENT = re.compile(r"^<!--.*?-->\n", re.MULTILINE | re.DOTALL)


class LongDescription(MetadataHookInterface):
    """Sets `readme` from README.md and the address `Repository` of `project.urls`, if it is given."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        text = (Path(self.root) / "README.md").read_text("utf-8")
        address = metadata.get("urls", {}).get("Repository")
        described = described_elsewhere(text, address)
        metadata["readme"] = {"content-type": "text/markdown", "text": described}


def described_elsewhere(text: str, repository: str | None) -> str:
    """Text of a README away from its repository, where the package is installed by its name.

    Links to files and pictures of the repository become links to its address. Without one nothing can be
    linked to: the words of a link stay, and pictures are left out, whose captions stay.
    """

    def there(found: re.Match[str]) -> str:
        picture, words, path = found.groups()
        if repository is None:
            return "" if picture else words
        kind = "raw" if picture else "blob"
        return f"{picture}[{words}]({repository.rstrip('/')}/{kind}/HEAD/{path})"

    for here, elsewhere in INSTALLED:
        text = text.replace(here, elsewhere)
    return LINK.sub(there, COMMENT.sub("", text))
