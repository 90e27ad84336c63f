"""Tables of what the pictures of a shot gave: outline, flyer, flight, reporting table."""

from pathlib import Path

import numpy as np

from dic import output
from dic.output import MM, write_history
from kolsky.bars.flyer import flight
from kolsky.shot.optical_data import Surfaces


def write_tables(folder: Path, found: Surfaces, number: np.ndarray) -> None:
    """Write outline and flyer as the exports that a shot can declare, the flight and the reporting table.

    ``folder``: where to; it exists. ``found``: what the pictures gave. ``number``: number of each frame as
    the shot counts them, shape [n_frames].
    """
    result = found.result
    line = result.centre
    write_history(
        folder / "centreline.csv",
        {
            "frame": number[line.frame],
            "time (s)": line.t,
            "y (mm)": MM * line.y,
            "Z (mm)": MM * line.Z,
            "sigma_Z (mm)": MM * line.sigma,
        },
    )
    if result.axial_displacement is not None:
        travel = result.axial_displacement
        write_history(
            folder / "flyer.csv",
            {
                "frame": number[travel.frame],
                "time (s)": travel.t,
                "flyer displacement toward the specimen (mm)": MM * travel.displacement,
                "sigma (mm)": MM * travel.sigma,
            },
        )
    table = output.reporting_table(result)
    (folder / "dic_reporting.csv").write_text(output.as_csv(table), encoding="utf-8")
    (folder / "dic_reporting.md").write_text(output.as_markdown(table), encoding="utf-8")
    if not isinstance(found.flight, str):
        write_history(folder / "flight.csv", flight.columns(found.flight))
