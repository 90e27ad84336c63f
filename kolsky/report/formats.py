"""Formats of a figure saved alone; separate, so that the command line loads no figures for them."""

FIGURE_FORMATS = ("pdf", "svg", "png", "csv")
"""Names of the formats; "csv" is the table of the data shown."""
