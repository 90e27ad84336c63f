"""What the HDF5 file of a stereo result holds: every dataset with its unit, dimensions and type."""

FORMAT = "dic stereo result"
VERSION = 2

STORED = {"f": "<f8", "i": "<i8", "b": "|b1"}
"""Kind of a dataset -> its type in the file; "t" is fixed-length UTF-8."""

Table = dict[str, tuple[str, str, str]]
"""Name -> (unit, names of the dimensions, kind). Dimensions of one name agree within one part of the file."""

ENTRY: Table = {
    "t": ("s", "frames", "f"),
    "frame_outcome_0": ("1", "frames", "i"),
    "frame_outcome_1": ("1", "frames", "i"),
    "static": ("1", "frames", "b"),
    "facts": ("", "", "t"),
    "remark_names": ("", "remarks", "t"),
    "remark_texts": ("", "remarks", "t"),
    "remark_cures": ("", "remarks", "t"),
    "stages": ("", "stages", "t"),
    "seconds": ("s", "stages", "f"),
}
BODY: Table = {
    "t": ("s", "frames", "f"),
    "X": ("m", "points three", "f"),
    "u": ("m", "frames points three", "f"),
    "sigma": ("m", "frames points three", "f"),
    "outcome": ("1", "frames points", "i"),
    "pixels_0": ("px", "frames points two", "f"),
    "pixels_1": ("px", "frames points two", "f"),
    "match_sigma_0": ("px", "frames points", "f"),
    "match_sigma_1": ("px", "frames points", "f"),
    "zncc_0": ("1", "frames points", "f"),
    "zncc_1": ("1", "frames points", "f"),
    "epipolar": ("px", "frames points", "f"),
    "points": ("px", "points two", "f"),
    "cell": ("1", "points two", "i"),
}
STRAIN: Table = {
    "value": ("1", "frames points three", "f"),
    "sigma": ("1", "frames points three", "f"),
    "outcome": ("1", "frames points", "i"),
    "gauge": ("px", "", "f"),
}
TRAVEL: Table = {
    "t": ("s", "rows", "f"),
    "frame": ("1", "rows", "i"),
    "displacement": ("m", "rows", "f"),
    "sigma": ("m", "rows", "f"),
    "n_points": ("1", "rows", "i"),
    "rest_sigma": ("m", "", "f"),
}
MOTION: Table = {
    "at": ("m", "three", "f"),
    "displacement": ("m", "frames three", "f"),
    "rotation": ("rad", "frames three", "f"),
    "covariance": ("rad^2 m^2", "frames six frames six", "f"),
    "n_points": ("1", "frames", "i"),
    "outcome": ("1", "frames", "i"),
    "chi2_per_dof": ("1", "", "f"),
    "noise_scale": ("1", "", "f"),
}
CENTRE: Table = {
    "t": ("s", "rows", "f"),
    "frame": ("1", "rows", "i"),
    "y": ("m", "rows", "f"),
    "Z": ("m", "rows", "f"),
    "sigma": ("m", "rows", "f"),
    "left_out_outcome": ("1", "outcomes", "i"),
    "left_out_count": ("1", "outcomes", "i"),
}
FRAME: Table = {
    "rotation": ("1", "three three", "f"),
    "origin": ("m", "three", "f"),
    "covariance": ("SI", "six six", "f"),
}
PLACEMENT: Table = {
    "radius": ("m", "", "f"),
    "radius_sigma": ("m", "", "f"),
    "rms": ("m", "", "f"),
    "chi2_per_dof": ("1", "", "f"),
    "n_points": ("1", "", "i"),
}
NOISE: Table = {
    "n_frames": ("1", "", "i"),
    "n_points": ("1", "", "i"),
    "time": ("m", "three", "f"),
    "space": ("m", "three", "f"),
    "common": ("m", "three", "f"),
    "sigma": ("m", "three", "f"),
}
CAMERA: Table = {
    "fx": ("px", "", "f"),
    "fy": ("px", "", "f"),
    "cx": ("px", "", "f"),
    "cy": ("px", "", "f"),
    "skew": ("px", "", "f"),
    "distortion": ("1", "five", "f"),
    "rotation": ("1", "three three", "f"),
    "translation": ("m", "three", "f"),
}
FIXED = {"two": 2, "three": 3, "five": 5, "six": 6}
"""Sizes of the dimensions that have one."""


def shape_problem(shape: tuple[int, ...], dimensions: str, sizes: dict[str, int]) -> str:
    """What is wrong with a shape, "" if nothing; new named dimensions are added to `sizes`."""
    names = dimensions.split()
    if len(shape) != len(names):
        return f"has {len(shape)} dimensions, expected {len(names)} ({dimensions or 'scalar'})"
    for name, size in zip(names, shape, strict=True):
        if sizes.setdefault(name, size) != size:
            return f"has {size} {name}, expected {sizes[name]}"
    return ""
