"""Exports of DIC programs: points of a surface, one text file a frame."""
