"""Instrument readers, one file format each."""
