"""What a notebook shows of a result, read back from its HTML."""

import xml.etree.ElementTree as tree


def shown(result):
    """Sentence, heads and rows of the table."""
    found = tree.fromstring(result._repr_html_())
    rows = [["".join(cell.itertext()) for cell in row] for row in found.iter("tr")]
    return "".join(found.find("p").itertext()), *(rows[:1] or [[]]), rows[1:]
