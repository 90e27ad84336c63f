"""Surfaces on disk: HDF5, CSV by VIC-3D's names, the reporting table."""

from dic.output.hdf5 import ResultFileError, read_result, stored_key, write_result

__all__ = ["ResultFileError", "read_result", "stored_key", "write_result"]
