"""Errors of surrogates of a shot's response at runs that none of them has seen.

`python -m benchmarks.surrogates SHOT --free NAME[=LOW:HIGH] ...` prints the root mean square over the noise,
of force and outline, for radial basis functions, Gaussian processes and Legendre polynomials (ridge chosen
by leave-one-out) on designs of doubling size.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from doe import Box, ResponseSurrogate, latin_hypercube, sobol
from doe.surrogates import ProcessSurrogate
from kolsky.cli.texts import ranges
from kolsky.inverse.objective import Objective
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Work
from kolsky.shot.load import load_shot

FloatArray = NDArray[np.float64]

HELD_OUT = 64
"""Runs at which the surrogates are compared."""
RIDGES = (1e-10, 1e-6, 1e-4, 1e-2, 1e-1)


def legendre_terms(unit: FloatArray, degree: int) -> FloatArray:
    """Products of Legendre polynomials up to a total degree, shape [n, terms]."""
    one = [legendre.legvander(2.0 * u - 1.0, degree) for u in unit.T]
    powers = [p for p in product(range(degree + 1), repeat=unit.shape[1]) if sum(p) <= degree]
    return np.stack([np.prod([v[:, k] for v, k in zip(one, p, strict=True)], axis=0) for p in powers], axis=1)


def polynomials(box: Box, x: FloatArray, y: FloatArray, at: FloatArray, degree: int) -> FloatArray | None:
    """Predictions at points, with the ridge that leaves one out best; None if there are too few runs."""
    terms = legendre_terms(box.unit(x), degree)
    if terms.shape[1] >= len(x):
        return None
    best: tuple[float, FloatArray] | None = None
    for ridge in RIDGES:
        gain = np.linalg.solve(terms.T @ terms + ridge * len(x) * np.eye(terms.shape[1]), terms.T)
        left_out = (y - terms @ (gain @ y)) / (1.0 - np.diag(terms @ gain))[:, None]
        error = float(np.sqrt(np.mean(left_out**2)))
        if best is None or error < best[0]:
            best = error, gain @ y
    assert best is not None
    return np.asarray(legendre_terms(box.unit(at), degree) @ best[1])


def main() -> None:
    """Run designs of 12 d, 24 d and 48 d runs, and the held-out ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shot", type=Path)
    parser.add_argument("--free", nargs="+", default=["stiffness_factor"])
    given = parser.parse_args()
    settings = Settings(free=ranges("--free", given.free))
    problem = InverseProblem.of(load_shot(given.shot), settings)
    box, prepared = problem.box, problem.prepared
    runner = Runner.of(problem, Work())
    tests = runner.simulate("held out", sobol(box, HELD_OUT, rng=3), settings.numerics)
    designs = [
        runner.simulate("design", latin_hypercube(box, n * box.dimension, rng=5), settings.numerics)
        for n in (12, 24, 48)
    ]
    inside = np.concatenate([runs.prediction.inside for runs in (tests, *designs)]).all(axis=0)
    objective = Objective(prepared.observations, np.asarray(inside))
    truth, noise, n_force = objective.vectors(tests.prediction), objective.noise, objective.n_force
    print("runs  surrogate                  force  outline   (rms over the noise)")
    for runs in designs:
        x, y = runs.points, objective.vectors(runs.prediction)
        found = {
            "radial basis functions": ResponseSurrogate.fit(box, x, y, scale=noise).predict(tests.points),
            "Gaussian processes": ProcessSurrogate.fit(box, x, y, scale=noise).predict(tests.points),
        }
        for degree in (2, 3, 4, 5):
            values = polynomials(box, x, y / noise, tests.points, degree)
            if values is not None:
                found[f"Legendre, degree {degree}"] = values * noise
        for name, values in found.items():
            error = ((values - truth) / noise) ** 2
            force, outline = np.sqrt(error[:, :n_force].mean()), np.sqrt(error[:, n_force:].mean())
            print(f"{len(x):4d}  {name:24s} {force:7.2f} {outline:8.2f}")


if __name__ == "__main__":
    main()
