"""Pictures of a shot.

Reading, calibration, correlation, storage in dic.h5, frame times, regions drawn by hand.
"""
