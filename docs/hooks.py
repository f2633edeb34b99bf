"""Pages of the site that are files of the repository, and tables quoted from them: no copies."""

import re
from pathlib import Path

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, InclusionLevel


REPOSITORY = Path(__file__).parents[1]
PAGES = {
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "benchmarks.md": "benchmarks/README.md",
}
LINK = re.compile(r"(\]\()(?:\.\./)?docs/")  # to a neighbour, once on the site
QUOTE = re.compile(r'^\{\{ quote (?P<file>\S+) "(?P<start>.+)" \}\}$', re.MULTILINE)


def on_files(files, config):
    """Adds each page with the text its file has now, so that no copy can fall behind."""
    for place, path in PAGES.items():
        text = LINK.sub(r"\1", (REPOSITORY / path).read_text("utf-8"))
        files.append(File.generated(config, place, content=text, inclusion=InclusionLevel.INCLUDED))
    return files


def on_page_markdown(markdown, page, config, files):
    """`{{ quote FILE "START" }}` becomes the lines of a file from START to the next empty one."""
    return QUOTE.sub(_quoted, markdown)


def on_page_content(html, page, config, files):
    """Refuses a page of the reference with a field that nothing describes."""
    if "has no description." in html:
        raise PluginError(
            f"{page.file.src_path}: give its field a comment, or a text in docs/fields.py."
        )
    return html


def _quoted(match):
    text = (REPOSITORY / match["file"]).read_text("utf-8")
    blocks = [block for block in text.split("\n\n") if block.startswith(match["start"])]
    if len(blocks) != 1:
        raise PluginError(f"{match[0]}: {len(blocks)} blocks of the file begin so, not one.")
    return blocks[0]


def on_serve(server, config, builder):
    """Looks at those files too while the site is served."""
    for path in PAGES.values():
        server.watch(str(REPOSITORY / path))
    return server
