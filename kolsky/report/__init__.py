"""Pages, figures, films and notebook views.

No other package uses Matplotlib.
"""

FIGURE_FORMATS = ("pdf", "svg", "png", "csv")
"""Names of the formats. "csv" is the table of the data in the figure."""
