"""Pages of the site that are files of the repository: README, CONTRIBUTING, CHANGELOG, benchmarks."""

import re
from pathlib import Path

from mkdocs.structure.files import File, InclusionLevel


REPOSITORY = Path(__file__).parents[1]
PAGES = {
    "index.md": "README.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "benchmarks.md": "benchmarks/README.md",
}
LINK = re.compile(r"(\]\()(?:\.\./)?docs/")  # to a neighbour, once on the site


def on_files(files, config):
    """Adds each page with the text its file has now, so that no copy can fall behind."""
    for place, path in PAGES.items():
        text = LINK.sub(r"\1", (REPOSITORY / path).read_text("utf-8"))
        files.append(File.generated(config, place, content=text, inclusion=InclusionLevel.INCLUDED))
    return files


def on_serve(server, config, builder):
    """Looks at those files too while the site is served."""
    for path in PAGES.values():
        server.watch(str(REPOSITORY / path))
    return server
