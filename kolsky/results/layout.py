"""What the HDF5 result file holds: every dataset with its unit, its dimensions and its type."""

from dataclasses import fields

from explicit import EnergyLedger
from kolsky.inverse.misfit import Terms

FORMAT = "kolsky identification"
VERSION = 2
READABLE = (1, 2)
"""Versions that are read; the first one knows no other choices, numbers of image correlation and parts of the
numerical uncertainty."""
STORED = {"f": "<f8", "i": "<i8", "b": "|b1", "t": "S"}
"""Kind of a dataset -> its type in the file."""

# One row a dataset: name -> (unit, names of the dimensions, kind), kind "f" float64, "i" int64, "b" bool,
# "t" text. Dimensions of one name must agree wherever they occur in one part of the file.
Table = dict[str, tuple[str, str, str]]

FORCE: Table = {
    "force_time": ("s", "bins", "f"),
    "force_measured": ("N", "bins", "f"),
    "force_sigma": ("N", "bins", "f"),
    "force_model": ("N", "bins", "f"),
}
PROFILE: Table = {
    "time": ("s", "points", "f"),
    "frame": ("1", "points", "i"),
    "y": ("m", "points", "f"),
    "Z": ("m", "points", "f"),
    "sigma": ("m", "points", "f"),
}
PROFILE_MODEL: Table = {"Z_model": ("m", "points", "f"), "inside": ("1", "points", "b")}
RECORDED: Table = {
    "time": ("s", "recorded", "f"),
    "force": ("N", "recorded", "f"),
    "sigma": ("N", "recorded", "f"),
}
DESIGN: Table = {
    "names": ("", "parameters", "t"),
    "points": ("SI", "runs parameters", "f"),
    "lower": ("SI", "parameters", "f"),
    "upper": ("SI", "parameters", "f"),
    "outcomes": ("", "runs", "t"),
    "end_times": ("s", "runs", "f"),
    "failed_elements": ("1", "runs", "i"),
    "failed_places": ("m", "runs two", "f"),
    "stage": ("", "runs", "t"),
    "phi_shape": ("1", "runs", "f"),
    "phi_force": ("N", "runs", "f"),
    "chi2_shape": ("1", "runs", "f"),
    "chi2_force": ("1", "runs", "f"),
}
CURVE: Table = {
    "parameter": ("", "", "t"),
    "x": ("SI", "x", "f"),
    "chi2": ("1", "x", "f"),
    "phi_shape": ("1", "x", "f"),
    "phi_force": ("N", "x", "f"),
}
RESPONSE: Table = {
    "force_times": ("s", "force_times", "f"),
    "force_flyer": ("N", "samples force_times", "f"),
    "force_transmission": ("N", "samples force_times", "f"),
    "impulse_flyer": ("N s", "samples force_times", "f"),
    "impulse_transmission": ("N s", "samples force_times", "f"),
    "surface_times": ("s", "surface_times", "f"),
    "surface_r": ("m", "samples surface_times surface_nodes", "f"),
    "surface_y": ("m", "samples surface_times surface_nodes", "f"),
    "outcomes": ("", "samples", "t"),
    "failed_elements": ("1", "samples", "i"),
    "failed_places": ("m", "samples two", "f"),
    "end_times": ("s", "samples", "f"),
    "steps": ("1", "samples", "i"),
    "smallest_step": ("s", "samples", "f"),
    "extrapolated_share": ("1", "samples", "f"),
    "largest_strain_measure": ("1", "samples", "f"),
}
NODES: Table = {"nodes": ("m", "samples surface_times nodes two", "f")}
ENERGY: Table = {f.name: ("J", "samples surface_times", "f") for f in fields(EnergyLedger)}
TERMS: Table = {
    f.name: (
        "N" if f.name in ("phi_force", "sigma_phi_force") else "1",
        "",
        "i" if f.name[:2] == "n_" else "f",
    )
    for f in fields(Terms)
}
ESTIMATE: Table = {
    "unit": ("", "", "t"),
    "value": ("", "", "f"),
    "sigma_noise": ("", "", "f"),
    "sigma_numerical": ("", "", "f"),
    "sigma_systematic": ("", "", "f"),
    "mesh_shift": ("", "", "f"),
    "outcome": ("", "", "t"),
}
ROUTE: Table = {"name": ("", "", "t"), "cost": ("1", "", "f")}
NUMBERS: Table = {"names": ("", "entries", "t"), "values": ("SI", "entries", "f")}
ENTRY: Table = {
    "shot": ("", "", "t"),
    "mesh": ("1", "two", "i"),
    "refined_mesh": ("1", "two", "i"),
    "warnings": ("", "warnings", "t"),
    "provenance": ("", "", "t"),
}


def shape_problem(shape: tuple[int, ...], dimensions: str, dims: dict[str, int]) -> str:
    """What is wrong with a shape, "" if nothing; new named dimensions are added to `dims`."""
    names = dimensions.split()
    if len(shape) != len(names):
        return f"has {len(shape)} dimensions, expected {len(names)} ({dimensions or 'scalar'})"
    for name, size in zip(names, shape, strict=True):
        if dims.setdefault(name, size) != size:
            return f"has {size} {name}, expected {dims[name]}"
    return ""
