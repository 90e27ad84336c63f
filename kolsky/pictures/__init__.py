"""Pictures of a shot: reading, calibration, correlation, storage in dic.h5, frame times, regions drawn by
hand."""
