"""Pages, figures, films, notebook views: the only room with Matplotlib and PyVista."""

FIGURE_FORMATS = ("pdf", "svg", "png", "csv")
"""Names of the formats; "csv" is the table of the data shown."""
