"""How many runs the optimum on the surrogate's mesh takes, by second designs and by adaptive refinement.

`python -m benchmarks.refinement SHOT --free NAME[=LOW:HIGH] ...` prints for each way the runs, the optimum
and the misfit of a real run there.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

import numpy as np

from kolsky.cli.texts import ranges
from kolsky.inverse.coarse_search import adaptive_design, second_design
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Work
from kolsky.shot.load import load_shot

WAYS = {"second designs": second_design, "adaptive refinement": adaptive_design}


def main() -> None:
    """Run both from the same first design."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shot", type=Path)
    parser.add_argument("--free", nargs="+", default=["stiffness_factor"])
    given = parser.parse_args()
    settings = Settings(free=ranges("--free", given.free))
    problem = InverseProblem.of(load_shot(given.shot), settings)
    box, prepared = problem.box, problem.prepared
    objective = Objective(
        prepared.observations, np.ones(len(prepared.observations.centre_line.Z), dtype=bool)
    )
    for name, way in WAYS.items():
        runner, started = Runner.of(problem, Work()), perf_counter()
        try:
            found = way(runner, runner.simulate("design", runner.design(box), settings.numerics))
        except ValueError as error:
            print(f"{name:20s} {error}")
            continue
        seconds, runs = perf_counter() - started, len(runner.table.points)
        values = dict(zip(box.names, found.x[:, None], strict=True))
        there = predict(prepared.forward.run(values, settings.numerics), prepared.observations)
        deviance = objective.deviance(objective.vectors(there))[0]
        place = ", ".join(f"{parameter} = {value:.6g}" for parameter, value in box.as_dict(found.x).items())
        print(f"{name:20s} {runs:4d} runs {seconds:6.1f} s  -2 ln L = {deviance:.1f} at {place}")


if __name__ == "__main__":
    main()
