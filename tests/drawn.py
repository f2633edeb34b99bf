"""What a plot drew, and where."""

import matplotlib.pyplot as plt


def lines(ax):
    """The lines in Axes by their labels."""
    return {line.get_label(): line for line in ax.lines}


def legend(ax):
    """The entries of the legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def check_axes(draw):
    """A plot draws in given Axes, or in a figure of its own, between a column and a page wide."""
    _, ax = plt.subplots()
    assert draw(ax) is ax
    assert 84.9 < 25.4 * draw(None).figure.get_figwidth() < 170.1
