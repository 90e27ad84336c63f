"""Two cameras: epipolar geometry, stereo match, triangulation, diagnosis."""
