"""One simulation of a shot compared with its data, and the quasi-static test of the same specimen."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explicit import Response
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.base.arrays import FloatArray
from kolsky.base.files import write_table
from kolsky.base.records import CentreLine
from kolsky.inverse.observations import LEAST_STEP, Prediction, predict, radius_at
from kolsky.inverse.parameters import PARAMETERS, any_slides, checked_value, require_effect
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.inverse.run_table import Terms, terms
from kolsky.inverse.settings import Numerics
from kolsky.material.slow_compression import FIRST, SlowCompression, SlowNumerics, slow_compression
from kolsky.shot.curve import PAST_CURVE
from kolsky.shot.records import Shot


@dataclass(frozen=True)
class Simulation:
    """One run and its misfit to the data."""

    parameters: dict[str, float]
    """The parameters that were named, in SI."""
    response: Response
    prediction: Prediction | None
    """The simulated measurements; None if the run did not complete."""
    terms: Terms | None
    """Misfit terms over the whole window, Eqs. (M.3)-(M.8); None if the run did not complete."""
    prepared: PreparedShot


def simulate(
    shot: Shot,
    parameters: Mapping[str, float],
    *,
    numerics: Numerics | None = None,
    progress: Callable[[int], None] | None = None,
) -> Simulation:
    """Simulate a shot with given parameters; other parameters keep the shot's values.

    A run that does not complete is returned too; `Simulation.response.describe(0)` gives the reason.

    Parameters
    ----------
    shot
        A loaded shot.
    parameters
        Values by name, of `kolsky.inverse.parameters.PARAMETERS`, SI.
    numerics
        Mesh, precision, device, element; None uses the defaults.
    progress
        Called with the number of runs just finished.

    Raises
    ------
    ValueError
        If a parameter is unknown or outside its range.
    """
    prepared = prepare_shot(shot)
    response = prepared.forward.run(
        {name: np.array([value]) for name, value in parameters.items()},
        numerics or Numerics(),
        all_nodes=True,
        progress=progress,
    )
    completed = response.outcomes[0].ok
    prediction = predict(response, prepared.observations) if completed else None
    return Simulation(
        parameters=dict(parameters),
        response=response,
        prediction=prediction,
        terms=None if prediction is None else terms(prediction, prepared.observations, 0),
        prepared=prepared,
    )


def write_simulation(folder: Path, simulation: Simulation) -> list[Path]:
    """Write force.csv and, if an outline was measured, profile.csv, with measured and simulated values.

    Files are written atomically. The tables of a failed run end at its failure.

    Parameters
    ----------
    folder
        Output folder; created if absent.
    simulation
        The run.
    """
    observations, response = simulation.prepared.observations, simulation.response
    line, force = observations.centre_line, observations.force
    if simulation.prediction is not None:
        seen = slice(None), simulation.prediction.force[0]
        points, Z, inside = slice(None), simulation.prediction.Z[0], simulation.prediction.inside[0]
    else:
        seen, (points, Z, inside) = _force_so_far(response, force.time), _outline_so_far(response, line)
    samples, simulated = seen
    tables: dict[str, dict[str, NDArray[Any]]] = {
        "force.csv": {
            "time (s)": force.time[samples],
            "measured force (N)": force.force[samples],
            "sigma (N)": force.sigma[samples],
            "simulated force (N)": simulated,
        }
    }
    if observations.has_shape:
        tables["profile.csv"] = {
            "frame": line.frame[points],
            "time (s)": line.time[points],
            "y (m)": line.y[points],
            "Z measured (m)": line.Z[points],
            "sigma Z (m)": line.sigma[points],
            "Z simulated (m)": Z,
            "inside (0/1)": inside.astype(np.int64),
        }
    return [write_table(Path(folder) / name, columns) for name, columns in tables.items()]


def _force_so_far(response: Response, recorded: FloatArray) -> tuple[slice, FloatArray]:
    """The recorded samples before the run's end, and the simulated force at these times [N]."""
    known = np.isfinite(response.force_transmission[0])
    time, force = response.force_times[known], response.force_transmission[0, known]
    count = int(np.searchsorted(recorded, time[-1], side="right")) if known.any() else 0
    return slice(count), np.interp(recorded[:count], time, force) if count else np.empty(0)


def _outline_so_far(response: Response, line: CentreLine) -> tuple[slice, FloatArray, NDArray[np.bool_]]:
    """The outline points before the run's end, their simulated radius [m] and a mask of reached points."""
    known = np.isfinite(response.surface_r[0]).all(axis=1)
    times = response.surface_times[known]
    count = int(np.searchsorted(line.time, times[-1], side="right")) if known.any() else 0
    Z, inside = np.full(count, np.nan), np.zeros(count, dtype=bool)
    row = np.searchsorted(times, line.time[:count])
    for k in np.unique(row):
        r, y = response.surface_r[0, known][k : k + 1], response.surface_y[0, known][k : k + 1]
        if not (np.diff(y) >= LEAST_STEP).any():
            continue  # crushed: no height is left between the platens, so no point is inside
        here = np.flatnonzero(row == k)
        Z[here], inside[here] = radius_at(r, y, np.zeros(len(here), dtype=np.intp), line.y[here])
    return slice(count), Z, inside


SLOW_POINTS = 60
"""Number of strains in the table."""
INERTIA = 0.01
"""Largest kinetic over elastic energy, and difference of the faces' forces over their force, not reported."""


def slow_test_of(
    shot: Shot,
    parameters: Mapping[str, float] | None = None,
    *,
    last: float | None = None,
    error: float = 2e-3,
    mesh: tuple[int, int] = (24, 32),
    threads: int | None = None,
) -> SlowCompression:
    """Compress the specimen of a shot slowly.

    ``parameters``: "stiffness_factor", "friction" or "poisson" at another value than the shot's. ``last``:
    last nominal compressive strain [-]; default: that at the end of the window. ``error``: relative error of
    the force. ``mesh``, ``threads``: elements across the radius and along the length, CPU threads. Raises
    ValueError if a parameter is not allowed or has no effect, or if the strain is not in (0, 1), and the
    errors of `kolsky.material.slow_compression.slow_compression`.
    """
    given = {name: checked_value(name, value) for name, value in (parameters or {}).items()}
    interface, sliding = shot.interface, any_slides(given)
    require_effect(given, interface.faces, interface.side)
    prepared = prepare_shot(shot)

    def value(name: str) -> float:
        return given.get(name, PARAMETERS[name].held(shot))

    if last is None:
        _, position, _ = prepared.path.table(2)
        last = float(position[-1] - position[0]) / shot.specimen.length
    if not 0.0 < last < 1.0:
        raise ValueError(f"the last strain of a slow test must be in (0, 1), got {last:.4g}")
    return slow_compression(
        prepared.forward.laws[0],
        shot.specimen,
        last * np.arange(1, SLOW_POINTS + 1) / SLOW_POINTS,
        faces=SLIDING_LAW if sliding else interface.faces,
        side=SLIDING_LAW if sliding else interface.side,
        friction=value("friction"),
        stiffness_factor=value("stiffness_factor"),
        error=error,
        numerics=SlowNumerics(mesh=mesh, passages=FIRST, poisson=value("poisson"), threads=threads),
    )


def slow_test_warnings(found: SlowCompression) -> list[str]:
    """Warnings about a simulated slow test."""
    said, test = [], found.test
    if test.kinetic_share > INERTIA or test.face_difference > INERTIA:
        said.append(
            f"the slow test is not at rest: its kinetic energy is {test.kinetic_share:.1%} of the elastic "
            f"one and the faces' forces differ by {test.face_difference:.1%}; give a smaller --error"
        )
    if test.past_data > PAST_CURVE:
        said.append(
            f"{test.past_data:.0%} of the specimen's volume was strained past the quasi-static curve; "
            "the law is extrapolated there"
        )
    return said
