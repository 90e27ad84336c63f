"""Instrument readers, one file format each: `read(path, *, <columns>)`, strict, without physics."""
