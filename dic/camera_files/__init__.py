"""Calibration files of other programs, read and written: one format a file."""
