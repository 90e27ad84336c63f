"""Does the interval cover the truth as often as it says? `python -m benchmarks.coverage`.

Every experiment is identified by `kolsky.identify.identify` itself, as a laboratory would, from its own
noisy force, outline, flyer and curve. Counted is how often the k = 2 interval holds the true value.
"""

import argparse
import json
import os
import platform
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from benchmarks.coverage_problem import FloatArray, draw, experiment, template, truths
from kolsky.forward import Numerics
from kolsky.identify import ONE_SIDED, ORDER, identify
from kolsky.settings import Settings

NAMES = {"m": "stiffness_factor", "f": "friction", "beta": "damping"}
BOUNDS = {"stiffness_factor": (0.75, 1.5), "friction": (0.05, 0.8), "damping": (5e-6, 6e-5)}
"""Bounds of the design; every truth lies well inside."""
NOMINAL = 0.9545
"""Share that an interval of k = 2 holds of a normal distribution."""
BATCH = 50
"""Truths of one batch on a CPU; their forces must fit into memory."""


@dataclass(frozen=True)
class Study:
    """What is asked."""

    free: tuple[str, ...]
    """Free parameters."""
    experiments: int
    """How many."""
    mesh: tuple[int, int] = (16, 22)
    """The surrogate's mesh."""
    refined_mesh: tuple[int, int] = (32, 44)
    """The mesh of the answer."""
    truth_mesh: tuple[int, int] = (48, 66)
    """The mesh of the truth, of F-bar elements."""
    device: str = "cpu"
    """Where both are run."""
    seed: int = 1
    """Of the truths and of all noise."""


@dataclass(frozen=True)
class Found:
    """One experiment and its answer; NaN where there is none."""

    truth: dict[str, float]
    value: dict[str, float]
    sigma: dict[str, float]
    """Combined standard uncertainty."""
    sigma_noise: dict[str, float]
    sigma_numerical: dict[str, float]
    mesh_shift: dict[str, float]
    profile: dict[str, tuple[float, float]]
    """95 % interval of the profile likelihood, noise of force and shape alone."""
    outcome: str
    """Verdicts, or why there is no answer."""
    seconds: float

    def covered(self, name: str) -> bool:
        """Whether the k = 2 interval holds the true value; no answer holds nothing."""
        return abs(self.value[name] - self.truth[name]) <= 2.0 * self.sigma[name]


def identified(study: Study, number: int, truth: dict[str, float], force: FloatArray, Z: FloatArray) -> Found:
    """Identify one experiment."""
    started = time.perf_counter()
    rng = np.random.default_rng([study.seed, 1, number])
    interface = "coulomb" if "friction" in study.free else "bonded"
    shot = experiment(number, force, Z, interface, rng)
    settings = Settings(
        free={name: BOUNDS[name] for name in study.free},
        numerics=Numerics(mesh=study.mesh, device=study.device, threads=1),
        refined_mesh=study.refined_mesh,
        replicate_mesh=study.mesh,
        seed=study.seed + number,
    )
    nothing = dict.fromkeys(study.free, float("nan"))
    try:
        result = identify(shot, settings)
    except ValueError as error:
        return Found(truth, nothing, nothing, nothing, nothing, nothing, {}, str(error), _since(started))
    e = result.estimates

    def each(field: str) -> dict[str, float]:
        return {name: float(getattr(e[name], field)) for name in study.free}

    return Found(
        truth=truth,
        value=each("value"),
        sigma=each("sigma"),
        sigma_noise=each("sigma_noise"),
        sigma_numerical=each("sigma_numerical"),
        mesh_shift=each("mesh_shift"),
        profile={profile.name: profile.interval for profile in result.profiles},
        outcome="; ".join(sorted({estimate.outcome.value for estimate in e.values()})),
        seconds=_since(started),
    )


def run(study: Study, *, workers: int) -> tuple[list[Found], dict[str, float]]:
    """All experiments, and the seconds that the truths and the identifications took."""
    started = time.perf_counter()
    draws = draw(study.free, study.experiments, np.random.default_rng([study.seed, 0]))
    seen, forces, radii = template(), [], []
    size = BATCH if study.device == "cpu" else study.experiments
    for first in range(0, study.experiments, size):
        rows = slice(first, first + size)
        part = type(draws)({name: value[rows] for name, value in draws.values.items()}, draws.interface)
        force, Z = truths(part, seen, mesh=study.truth_mesh, device=study.device)
        forces.append(force)
        radii.append(Z)
    made = _since(started)
    started = time.perf_counter()
    truth = [{name: float(draws.values[name][i]) for name in study.free} for i in range(study.experiments)]
    work = (range(study.experiments), truth, np.concatenate(forces), np.concatenate(radii))
    if workers == 1:
        found = list(map(partial(identified, study), *work))
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            found = list(pool.map(partial(identified, study), *work))
    return found, {"truths": made, "identifications": _since(started)}


def summary(study: Study, found: list[Found]) -> dict[str, Any]:
    """How often each interval held the truth, with what chance allows of an exact one."""
    n = len(found)
    low, high = binom.interval(0.95, n, NOMINAL)
    rows: dict[str, Any] = {}
    for name in study.free:
        good = [one for one in found if np.isfinite(one.value[name])]
        error = np.array([one.value[name] - one.truth[name] for one in good])
        sigma = np.array([one.sigma[name] for one in good])
        noise = np.array([one.sigma_noise[name] for one in good])
        mesh = np.array([one.sigma_numerical[name] for one in good])
        shift = np.array([one.mesh_shift[name] for one in good])
        less = error + shift / ((study.refined_mesh[0] / study.mesh[0]) ** ORDER - 1.0)
        half = np.hypot(noise, 0.5 * ONE_SIDED * mesh)
        within = [  # an open end is NaN, which nothing is beyond
            not (one.truth[name] < one.profile[name][0] or one.truth[name] > one.profile[name][1])
            for one in good
            if name in one.profile
        ]
        rows[name] = {
            "covered": sum(one.covered(name) for one in found) / n,
            "answers": len(good),
            "mean error": float(error.mean()),
            "scatter": float(error.std(ddof=1)),
            "mean sigma": float(sigma.mean()),
            "mean sigma noise": float(noise.mean()),
            "mean sigma numerical": float(mesh.mean()),
            "mean shift between meshes": float(shift.mean()),
            "mean error less the estimated one of the mesh": float(less.mean()),
            "covered with half the grid convergence index": float(np.mean(np.abs(error) <= 2.0 * half)),
            "covered by the profile likelihood alone": float(np.mean(within)) if within else None,
        }
    return {"experiments": n, "exact interval, 95 % of studies": [low / n, high / n], **rows}


def main() -> None:
    """Run a study and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--free", default="m", help="m, or m,f,beta")
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--mesh", default="16x22", help="of the surrogate")
    parser.add_argument("--refined-mesh", default="32x44", help="of the answer")
    parser.add_argument("--truth-mesh", default="48x66", help="of the truth, F-bar")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--workers", type=int, default=1, help="processes that identify")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="JSON file")
    given = parser.parse_args()
    study = Study(
        free=tuple(NAMES[name] for name in given.free.split(",")),
        experiments=given.experiments,
        mesh=_mesh(given.mesh),
        refined_mesh=_mesh(given.refined_mesh),
        truth_mesh=_mesh(given.truth_mesh),
        device=given.device,
        seed=given.seed,
    )
    found, seconds = run(study, workers=given.workers)
    machine = {"device": given.device, "processor": platform.machine(), "cores": os.cpu_count() or 1}
    said = {
        "machine": machine,
        "study": asdict(study),
        "workers": given.workers,
        "seconds": seconds,
        **summary(study, found),
    }
    print(json.dumps(said, indent=2))
    if given.out is not None:
        given.out.write_text(json.dumps({**said, "each": [asdict(one) for one in found]}, indent=1) + "\n")


def _mesh(text: str) -> tuple[int, int]:
    across, along = text.split("x")
    return int(across), int(along)


def _since(started: float) -> float:
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
