"""Formats of a figure that is saved alone."""

FIGURES = ("pdf", "svg", "png", "csv")
"""Their names; csv is the data that it shows."""
