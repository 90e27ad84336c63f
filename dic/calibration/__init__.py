"""Calibration of cameras and their poses from pictures of targets."""
