"""Pictures of a shot: reading, calibration, correlation, dic.h5, frame times, regions drawn by hand."""
