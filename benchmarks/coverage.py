"""Does the interval cover the truth as often as it says? `python -m benchmarks.coverage`.

Every experiment is identified by `kolsky.identification.identify` itself, as a laboratory would, from its own
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

from benchmarks.coverage_counts import joined, summary
from benchmarks.coverage_problem import FloatArray, draw, experiment, template, truths
from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.settings import Settings

NAMES = {"m": "stiffness_factor", "f": "friction", "beta": "damping"}
BOUNDS = {"stiffness_factor": (0.75, 1.5), "friction": (0.05, 0.8), "damping": (5e-6, 6e-5)}
"""Bounds of the design; every truth lies well inside."""
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
    rows: tuple[int, int] | None = None
    """First experiment, and the one after the last, of those that are done now; all if left out."""

    @property
    def numbers(self) -> range:
        """The experiments that are done now."""
        return range(*(self.rows or (0, self.experiments)))


@dataclass(frozen=True)
class Found:
    """One experiment and its answer; NaN where there is none."""

    truth: dict[str, float]
    value: dict[str, float]
    sigma: dict[str, float]
    """Combined standard uncertainty."""
    sigma_noise: dict[str, float]
    sigma_numerical: dict[str, float]
    parts: dict[str, dict[str, float]]
    """Standard uncertainties of each parameter by source, of the noise and of the numerics."""
    mesh_shift: dict[str, float]
    profile: dict[str, tuple[float, float]]
    """95 % interval of the profile likelihood, noise of force and shape alone."""
    outcome: str
    """Verdicts, or why there is no answer."""
    seconds: float


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
        return Found(truth, nothing, nothing, nothing, nothing, {}, nothing, {}, str(error), _since(started))
    e = result.estimates

    def each(field: str) -> dict[str, float]:
        return {name: float(getattr(e[name], field)) for name in study.free}

    return Found(
        truth=truth,
        value=each("value"),
        sigma=each("sigma"),
        sigma_noise=each("sigma_noise"),
        sigma_numerical=each("sigma_numerical"),
        parts={name: {**e[name].noise_parts, **e[name].numerical_parts} for name in study.free},
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
    numbers = study.numbers
    for first in range(numbers.start, numbers.stop, size):
        rows = slice(first, min(first + size, numbers.stop))
        part = type(draws)({name: value[rows] for name, value in draws.values.items()}, draws.interface)
        force, Z = truths(part, seen, mesh=study.truth_mesh, device=study.device)
        forces.append(force)
        radii.append(Z)
    made = _since(started)
    started = time.perf_counter()
    truth = [{name: float(draws.values[name][i]) for name in study.free} for i in numbers]
    work = (numbers, truth, np.concatenate(forces), np.concatenate(radii))
    if workers == 1:
        found = list(map(partial(identified, study), *work))
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            found = list(pool.map(partial(identified, study), *work))
    return found, {"truths": made, "identifications": _since(started)}


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
    parser.add_argument("--rows", help="FIRST:STOP, a part of the experiments; the parts are then joined")
    parser.add_argument("--join", type=Path, nargs="+", help="files of parts: sum them up, run nothing")
    parser.add_argument("--out", type=Path, help="JSON file")
    given = parser.parse_args()
    if given.join:
        _tell(joined([json.loads(path.read_text()) for path in given.join]), given.out)
        return
    study = Study(
        free=tuple(NAMES[name] for name in given.free.split(",")),
        experiments=given.experiments,
        mesh=_mesh(given.mesh),
        refined_mesh=_mesh(given.refined_mesh),
        truth_mesh=_mesh(given.truth_mesh),
        device=given.device,
        seed=given.seed,
        rows=None if given.rows is None else _rows(given.rows),
    )
    found, seconds = run(study, workers=given.workers)
    machine = {"device": given.device, "processor": platform.machine(), "cores": os.cpu_count() or 1}
    each = [asdict(one) for one in found]
    said = {"machine": machine, "study": asdict(study), "workers": given.workers, "seconds": seconds}
    _tell({**said, **summary(each, study.refined_mesh[0] / study.mesh[0]), "each": each}, given.out)


def _tell(said: dict[str, Any], out: Path | None) -> None:
    print(json.dumps({key: value for key, value in said.items() if key != "each"}, indent=2))
    if out is not None:
        out.write_text(json.dumps(said, indent=1) + "\n")


def _rows(text: str) -> tuple[int, int]:
    first, stop = text.split(":")
    return int(first), int(stop)


def _mesh(text: str) -> tuple[int, int]:
    across, along = text.split("x")
    return int(across), int(along)


def _since(started: float) -> float:
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
