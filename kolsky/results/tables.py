"""A result as CSV tables."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import write_table
from kolsky.inverse.result import Identification
from kolsky.inverse.run_table import DesignTable


def write_csv(folder: Path, identification: Identification) -> list[Path]:
    """Write force.csv, profile.csv, design.csv and energy.csv, units in the headers, each atomically.

    Parameters
    ----------
    folder : Path
        Where to; made if absent.
    identification : Identification
        What is written.

    Returns
    -------
    list of Path
        The four files. Values are SI with 9 significant digits; "nan" where there is none.
    """
    named = tables(identification).items()
    return [write_table(Path(folder) / f"{name}.csv", columns) for name, columns in named]


def tables(identification: Identification) -> dict[str, dict[str, Any]]:
    """Force, profile, design and energy as named columns, SI, units in the names."""
    result, comparison, design = identification, identification.comparison, identification.design
    line, ledger = comparison.centre_line, identification.response.energy
    force = {
        "time (s)": comparison.force_time,
        "measured force (N)": comparison.force_measured,
        "sigma (N)": comparison.force_sigma,
        "simulated force (N)": comparison.force_model,
    }
    profile = {
        "frame": line.frame,
        "time (s)": line.time,
        "y (m)": line.y,
        "Z measured (m)": line.Z,
        "sigma Z (m)": line.sigma,
        "Z simulated (m)": comparison.Z_model,
        "inside (0/1)": comparison.inside.astype(np.int64),
    }
    units = {name: estimate.unit for name, estimate in result.estimates.items()}
    runs: dict[str, Any] = {"run": np.arange(len(design.outcomes)), "stage": design.stage}
    runs |= {f"{n} ({units.get(n, 'SI')})": design.points[:, i] for i, n in enumerate(design.names)}
    runs |= {
        "outcome": design.outcomes,
        "Phi_F (N)": design.phi_force,
        "Phi_S (1)": design.phi_shape,
        "chi2 force (1)": design.chi2_force,
        "chi2 shape (1)": design.chi2_shape,
        **ends(design),
    }
    energy = {"time (s)": result.response.surface_times}
    energy |= {f"{f.name} (J)": getattr(ledger, f.name)[0] for f in fields(ledger)}
    energy |= {"residual (J)": ledger.residual[0]}

    return {"force": force, "profile": profile, "design": runs, "energy": energy}


def ends(design: DesignTable) -> dict[str, Any]:
    """Columns of a CSV table: the time a run reached and, if it failed, its element and what happened."""
    r, y = design.failed_places.T
    lost = set(design.lost)
    return {
        "end (s)": design.end_times,
        "element": [str(e) if e >= 0 else "" for e in design.failed_elements],
        "element R (m)": [f"{x:.9g}" if np.isfinite(x) else "" for x in r],
        "element Y (m)": [f"{x:.9g}" if np.isfinite(x) else "" for x in y],
        "ending": [design.ending(i).sentence if i in lost else "" for i in range(len(design.points))],
    }
