"""Surfaces on disk: HDF5, CSV, VTU, the reporting table."""
