"""Names of the columns in the exports of DIC programs."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class ExportLayout:
    """The columns of one program's export; a name is compared without its unit in brackets."""

    program: str
    """The program, and its version where the names changed."""
    coordinates: tuple[str, str, str]
    """Columns of the position: in the reference frame or in the current one, which the numbers tell."""
    displacements: tuple[str, str, str]
    """Columns of the displacement from the reference frame."""
    key: tuple[str, ...] = ()
    """Columns that say which point a row is, the same in every frame; without them rows keep their order."""
    rejected: tuple[str, ...] = ()
    """Columns that are negative where the program gave a point up; those that are there count."""


LAYOUTS: Mapping[str, tuple[ExportLayout, ...]] = {
    "vic3d": (
        # Data export as CSV; sigma is -1 where a subset was not matched.
        ExportLayout("VIC-3D", ("X", "Y", "Z"), ("U", "V", "W"), key=("x", "y"), rejected=("sigma",)),
    ),
    "aramis": (
        # https://github.com/dlr-wf/aramis-data-exporter (nodemap.txt): lost facets are NaN.
        ExportLayout(
            "ARAMIS, data exporter", ("x_undef", "y_undef", "z_undef"), ("u", "v", "w"), key=("ID",)
        ),
        ExportLayout(
            "GOM Inspect, ARAMIS Professional",
            ("x", "y", "z"),
            ("displacement_x", "displacement_y", "displacement_z"),
            key=("id",),
        ),
    ),
    "matchid": (
        ExportLayout(
            "MatchID 2024",
            ("coor.X", "coor.Y", "coor.Z"),
            ("disp.Horizontal Displacement U", "disp.Vertical Displacement V", "disp.Out-Of-Plane: W"),
            key=("Coordinates.Image X", "Coordinates.Image Y"),
        ),
        ExportLayout("MatchID to 2023", ("x", "y", "z"), ("u", "v", "w"), key=("x_pic", "y_pic")),
    ),
    "dice": (
        # Field names of https://github.com/dicengine/dice; GAMMA, SIGMA and MATCH are -1 for a failed subset.
        ExportLayout(
            "DICe",
            ("MODEL_COORDINATES_X", "MODEL_COORDINATES_Y", "MODEL_COORDINATES_Z"),
            ("MODEL_DISPLACEMENT_X", "MODEL_DISPLACEMENT_Y", "MODEL_DISPLACEMENT_Z"),
            key=("SUBSET_ID",),
            rejected=("SIGMA", "MATCH", "GAMMA"),
        ),
        ExportLayout(
            "DICe without subset numbers",
            ("MODEL_COORDINATES_X", "MODEL_COORDINATES_Y", "MODEL_COORDINATES_Z"),
            ("MODEL_DISPLACEMENT_X", "MODEL_DISPLACEMENT_Y", "MODEL_DISPLACEMENT_Z"),
            key=("COORDINATE_X", "COORDINATE_Y"),
            rejected=("SIGMA", "MATCH", "GAMMA"),
        ),
    ),
    "opencorr": (
        ExportLayout(
            "OpenCorr",
            ("ref_x", "ref_y", "ref_z"),
            ("u", "v", "w"),
            key=("x", "y"),
            rejected=("r1r2 ZNCC", "r1t1 ZNCC", "r1t2 ZNCC"),
        ),
    ),
}
"""Name in shot.toml -> layouts, the first of which that has all its columns in the header is used."""
