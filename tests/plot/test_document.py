"""Documents: numbered tables and figures, in HTML and PDF."""

import re
import zlib

import pytest

from jaxrotor.plot import document
from jaxrotor.plot.document import Heading, Picture, Sentence, Table, write_document


PARTS = [
    Heading("One & two"),
    Sentence("A sentence with \N{GREEK SMALL LETTER OMEGA} < 3."),
    Table("speeds", ("name", "rpm"), [("first", "100"), ("last", "FAIL")], (1,)),
    Picture("a line", lambda ax: ax.plot([0, 1]), width=80, height=40),
    Table("others", ("name",), [("x",)]),
    Picture("two rows", lambda axes: axes[1].plot([0, 1]), width=80, height=60, rows=2),
]


def test_tables_and_figures_are_numbered(tmp_path):
    write_document(tmp_path / "a.html", "Title <1>", PARTS)
    page = (tmp_path / "a.html").read_text("utf-8")
    assert re.findall(r"Table \d: \w+", page) == ["Table 1: speeds", "Table 2: others"]
    assert re.findall(r"<figcaption>(Figure \d: [\w ]+)", page) == [
        "Figure 1: a line",
        "Figure 2: two rows",
    ]
    assert "Title &lt;1&gt;" in page
    assert page.count("data:image/png;base64,") == 2
    assert page.count('class="fail"') == 1  # the cell, as the caption has no such word


def test_a_pdf_has_its_pictures_and_pages(tmp_path):
    write_document(tmp_path / "a.pdf", "Title", [*PARTS, *PARTS, *PARTS])
    content = (tmp_path / "a.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    (pages,) = re.findall(rb"/Count (\d+)", content)
    assert int(pages) >= 2
    assert content.count(b"/Subtype /Image") >= 2
    streams = re.findall(rb"stream\n(.*?)\nendstream", content, re.DOTALL)
    assert any(b" Tj" in zlib.decompress(one) for one in streams if one[:1] == b"x")


def test_pictures_are_drawn_once_for_all_files(tmp_path):
    drawn = []
    write_document(
        [tmp_path / "a.html", tmp_path / "a.pdf"], "Title", [Picture("one", drawn.append)]
    )
    assert len(drawn) == 1
    assert (tmp_path / "a.html").exists() and (tmp_path / "a.pdf").exists()


def test_words_without_the_package_for_pdf(tmp_path, monkeypatch):
    monkeypatch.setattr(document, "writes_pdf", lambda: False)
    with pytest.raises(ValueError, match="pip install fpdf2"):
        write_document([tmp_path / "a.html", tmp_path / "a.pdf"], "Title", PARTS)
    assert list(tmp_path.iterdir()) == []


def test_words_for_another_ending(tmp_path):
    with pytest.raises(ValueError, match="ends in .html or .pdf, but is a.doc"):
        write_document(tmp_path / "a.doc", "Title", PARTS)


def test_nothing_is_left_of_a_document_that_failed(tmp_path):
    def broken(ax):
        raise RuntimeError("no picture")

    with pytest.raises(RuntimeError):
        write_document(tmp_path / "a.html", "Title", [Picture("broken", broken)])
    assert list(tmp_path.iterdir()) == []
