"""Results on disk: an identification as HDF5, JSON and CSV tables, written completely or not at all."""
