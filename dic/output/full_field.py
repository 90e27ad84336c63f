"""Full-field results as tables: one file a frame, and the histories of extensometers and means."""

from pathlib import Path

import numpy as np

from dic.full_field.result import FullField
from dic.outcome import FrameOutcome, PointOutcome
from dic.output.csv import write_history
from dic.surfaces.strains import StrainOutcome


def write_full_field_frames(folder: Path, result: FullField) -> list[Path]:
    """Write the points of every frame, ``frame_0000.csv`` and so on.

    A row a point, in this order: the place x0, y0 in the reference picture [px]; X, Y, Z, U, V, W with
    sigma_U, sigma_V, sigma_W in the unit that the heads of the columns name; the Green-Lagrange strains exx,
    eyy, exy with their sigmas; the lowest correlation of the cameras; the epipolar distance; the outcome. A
    number that is not known is an empty cell.

    Parameters
    ----------
    folder
        Where to; made if absent.
    result
        The result.
    """
    folder.mkdir(parents=True, exist_ok=True)
    surface, unit, written = result.surface, result.unit, []
    names = np.array([member.name for member in PointOutcome])
    for frame in range(surface.n_frames):
        columns = {"x0 (px)": result.points[:, 0], "y0 (px)": result.points[:, 1]}
        columns |= {f"{name} ({unit})": surface.X[:, k] for k, name in enumerate("XYZ")}
        columns |= {f"{name} ({unit})": surface.u[frame, :, k] for k, name in enumerate("UVW")}
        columns |= {f"sigma_{name} ({unit})": surface.sigma[frame, :, k] for k, name in enumerate("UVW")}
        columns |= {name: result.strain.value[frame, :, k] for k, name in enumerate(("exx", "eyy", "exy"))}
        columns |= {
            f"sigma_{name}": result.strain.sigma[frame, :, k] for k, name in enumerate(("exx", "eyy", "exy"))
        }
        columns["zncc"] = result.zncc[:, frame].min(axis=0)
        columns["epipolar (px)"] = result.epipolar[frame]
        columns["outcome"] = names[surface.outcome[frame]]
        path = folder / f"frame_{frame:04d}.csv"
        write_history(path, columns)
        written.append(path)
    return written


def write_full_field_history(path: Path, result: FullField) -> None:
    """Write one row a frame: points found, mean strains, and what extensometers and cylinder say.

    Parameters
    ----------
    path
        The file.
    result
        The result.
    """
    unit, mean = result.unit, result.mean_strain
    columns = {
        "frame": np.arange(result.surface.n_frames),
        "time (s)" if result.timed else "time (frames)": result.surface.t,
        "outcome": np.array([FrameOutcome(int(k)).name for k in result.frame_outcome]),
        "points": result.n_valid,
        **{f"mean {name}": mean[:, k] for k, name in enumerate(("exx", "eyy", "exy"))},
    }
    for one in result.extensions:
        columns |= {
            f"{one.name} length ({unit})": one.length,
            f"{one.name} elongation ({unit})": one.elongation,
            f"{one.name} sigma ({unit})": one.sigma,
            f"{one.name} strain": one.strain,
            f"{one.name} outcome": np.array([StrainOutcome(int(k)).name for k in one.outcome]),
        }
    if result.cylinder is not None:
        columns |= {
            "radius (m)": result.cylinder.radius,
            "sigma of the radius (m)": result.cylinder.sigma,
            "rms from the cylinder (m)": result.cylinder.rms,
        }
    write_history(path, columns)
