"""Results on disk: an identification as HDF5, JSON and CSV tables, written whole or not at all."""
