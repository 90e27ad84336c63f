"""Results on disk: an identification as HDF5, JSON and CSV tables, written whole or not at all."""

from kolsky.results.read import read_identification
from kolsky.results.text import tables, to_json, write_csv
from kolsky.results.write import write_identification

__all__ = ["read_identification", "tables", "to_json", "write_csv", "write_identification"]
