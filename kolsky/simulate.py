"""One simulation of a shot beside its data."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from explicit import Response
from kolsky.csvtable import write_table
from kolsky.forward import Numerics
from kolsky.identification import Terms
from kolsky.misfit import Prediction, predict, terms
from kolsky.prepare import Prepared, prepare
from kolsky.shots import Shot


@dataclass(frozen=True)
class Simulation:
    """One run and how far it is from the data."""

    parameters: dict[str, float]
    """The parameters that were named, in SI."""
    response: Response
    """The run, a batch of one, with all nodes."""
    prediction: Prediction
    """What the instruments would have seen."""
    terms: Terms
    """Misfit terms, Eqs. (M.3)-(M.8)."""
    prepared: Prepared
    """The observations it is compared with."""


def simulate(
    shot: Shot,
    parameters: Mapping[str, float],
    *,
    numerics: Numerics | None = None,
    progress: Callable[[int], None] | None = None,
) -> Simulation:
    """Simulate a shot with given parameters; those not named keep the shot's values.

    Raises
    ------
    ValueError
        If a parameter is unknown or outside its range, or if the run did not complete.
    """
    prepared = prepare(shot)
    response = prepared.forward.run(
        {name: np.array([value]) for name, value in parameters.items()},
        numerics or Numerics(),
        all_nodes=True,
        progress=progress,
    )
    outcome = response.outcomes[0]
    if not outcome.ok:
        raise ValueError(
            f"the simulation ended at {response.end_times[0]:.6g} s: {outcome.cause}. Cure: {outcome.cure}"
        )
    prediction = predict(response, prepared.observations)
    return Simulation(
        parameters=dict(parameters),
        response=response,
        prediction=prediction,
        terms=terms(prediction, prepared.observations, 0),
        prepared=prepared,
    )


def write_simulation(folder: Path, simulation: Simulation) -> list[Path]:
    """Write force.csv and profile.csv, measured beside simulated, each atomically."""
    observations, prediction = simulation.prepared.observations, simulation.prediction
    line, force = observations.centre_line, observations.force
    folder = Path(folder)
    return [
        write_table(
            folder / "force.csv",
            {
                "time (s)": force.time,
                "measured force (N)": force.force,
                "sigma (N)": force.sigma,
                "simulated force (N)": prediction.force[0],
            },
        ),
        write_table(
            folder / "profile.csv",
            {
                "frame": line.frame,
                "time (s)": line.time,
                "y (m)": line.y,
                "Z measured (m)": line.Z,
                "sigma Z (m)": line.sigma,
                "Z simulated (m)": prediction.Z[0],
                "inside (0/1)": prediction.inside[0].astype(np.int64),
            },
        ),
    ]
