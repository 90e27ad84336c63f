"""Effect of each mechanism of `identify`: `python -m populations.ablation --out FOLDER --workers N`.

Correct shots of the population of `populations.wrong_inputs` (each seed gives one population) are identified
with all mechanisms, and with one mechanism switched off at a time. The table has one row for each switch. Its
columns are: processor seconds and element updates of an answer, relative to 100 runs of the solver's problem;
the errors of m, nu and beta over their standard uncertainties (root mean square); the error of m and its
uncertainty; the number of shots that are identified with every true value within k = 2. A mechanism is
unnecessary if its row is not significantly worse than the first.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from kolsky.inverse.settings import Numerics, Settings
from populations.driver import USUAL, add_meshes, answers, command, write
from populations.wrong_inputs import POPULATION, made

NAMES = {"stiffness_factor": "m", "poisson": "poisson", "damping": "damping"}
"""Free parameters and their keys in truth.json."""


@dataclass(frozen=True)
class Switch:
    """One mechanism that is switched off."""

    words: str
    """Description of the missing mechanism."""
    patches: tuple[tuple[str, Callable[..., Any] | int | float], ...] = ()
    """Replacements, by the full names of the replaced objects."""
    settings: Callable[[Settings], Settings] = lambda settings: settings
    """Function that changes the settings."""

    @contextmanager
    def off(self) -> Iterator[None]:
        """Context in which the mechanism is off."""
        with ExitStack() as stack:
            for target, value in self.patches:
                stack.enter_context(patch(target, value))
            yield


def _unmoved(runner: Any, objective: Any, slope: Any, last: Any, search: Any) -> Any:
    """Replacement of `follow_on_refined` that returns its input."""
    return last, slope, runner.front


def _start_of_finest(optima: Any, mesh: Any, refined: Any) -> Any:
    """Replacement of `extrapolated_start` without extrapolation."""
    return optima[mesh].x


GAUSS_NEWTON = "kolsky.inverse.gauss_newton"
SWITCHES: dict[str, Switch] = {
    "all": Switch("nothing"),
    "half_patterns": Switch(
        "half of the patterns of the path's noise", (("kolsky.inverse.runner.PATTERNS", 8),)
    ),
    "path_on_refined": Switch(
        "the path followed on the mesh of the steps", ((f"{GAUSS_NEWTON}.follow_on_refined", _unmoved),)
    ),
    "extrapolated_start": Switch(
        "the start extrapolated from two meshes", ((f"{GAUSS_NEWTON}.extrapolated_start", _start_of_finest),)
    ),
    "half_surrogate": Switch(
        "half of the runs of the surrogate about the answer", ((f"{GAUSS_NEWTON}.RUNS_PER_PARAMETER", 3),)
    ),
    "half_replicates": Switch(
        "half of the curve's draws", settings=lambda settings: replace(settings, replicates=16)
    ),
    "coarser_refined": Switch(
        "a refined mesh of 48 x 64 (40 x 54 instead)",
        settings=lambda settings: replace(settings, refined_mesh=(40, 54)),
    ),
    "finer_refined": Switch(
        "nothing; a refined mesh of 64 x 86",
        settings=lambda settings: replace(settings, refined_mesh=(64, 86)),
    ),
    "coarser_surrogate": Switch(
        "a surrogate's mesh of 20 x 27 (18 x 24 instead)",
        settings=lambda settings: replace(settings, numerics=settings.numerics.with_mesh((18, 24))),
    ),
    "finer_surrogate": Switch(
        "nothing; a surrogate's mesh of 24 x 32",
        settings=lambda settings: replace(settings, numerics=settings.numerics.with_mesh((24, 32))),
    ),
    "held": Switch(
        "nothing; the stiffness factor alone is free",
        settings=lambda settings: replace(settings, free={"stiffness_factor": None}),
    ),
    "mesh_correction": Switch(
        "the mesh's correction of the answer",
        (("kolsky.uncertainty.mesh_error.MeshChange.correction", lambda self, gain: np.zeros(len(gain))),),
    ),
    "discrepancy": Switch(
        "the discrepancies in the weights",
        (("kolsky.inverse.objective.Objective.with_discrepancy", lambda self, vector: self),),
    ),
    "second_start": Switch(
        "the causes' second start", (("kolsky.inverse.search.Search.held_run", lambda self: None),)
    ),
}


def answer(
    shot: Path,
    name: str,
    mesh: tuple[int, int] = USUAL.numerics.mesh,
    refined: tuple[int, int] = USUAL.refined_mesh,
) -> dict[str, Any]:
    """One identification with a switch off."""
    from benchmarks.identify import UPDATES, Ledger, unit
    from kolsky.identification import identify

    switch, truth = SWITCHES[name], json.loads((shot / "truth.json").read_text("utf-8"))
    settings = switch.settings(Settings(numerics=Numerics(mesh=mesh, threads=1), refined_mesh=refined))
    one, ledger, started = unit(1), Ledger(), time.process_time()
    try:
        with switch.off(), ledger.watching():
            found = identify(shot, settings)
    except ValueError as error:
        return {"shot": shot.name, "switch": name, "broke": str(error)}
    taken = time.process_time() - started
    said = {
        key: {"value": e.value, "sigma": e.sigma, "truth": truth[NAMES[key]], "outcome": e.outcome.value}
        for key, e in found.estimates.items()
    }
    identified = found.estimates["stiffness_factor"].outcome.identified
    causes = [cause.key for cause in found.causes if cause.named]
    return {
        "shot": shot.name,
        "switch": name,
        "ratio": taken / one,
        "updates": sum(cost.updates for cost in ledger.costs.values()) / UPDATES,
        "said": said,
        "identified": identified,
        "causes": causes,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown table with one row for each switch."""
    lines = [
        "| off | shots | seconds | updates | error over u: m, nu, beta | error of m, rms | U of m | right |",
        "| --- " * 8 + "|",
    ]
    for name, switch in SWITCHES.items():
        mine = [row for row in rows if row["switch"] == name]
        whole = [row for row in mine if "broke" not in row]
        if not whole:
            continue
        z = {key: np.array([_z(row, key) for row in whole if key in row["said"]]) for key in NAMES}
        m = [row["said"]["stiffness_factor"] for row in whole]
        error = np.array([one["value"] / one["truth"] - 1.0 for one in m])
        half = np.array([2.0 * one["sigma"] / one["truth"] for one in m])
        right = sum(
            row["identified"] and all(abs(_z(row, key)) <= 2.0 for key in row["said"]) for row in whole
        )
        said = ", ".join(f"{np.sqrt((z[key] ** 2).mean()):.2f}" if len(z[key]) else "-" for key in NAMES)
        lines.append(
            f"| {switch.words} | {len(mine)} | {np.mean([row['ratio'] for row in whole]):.1f} "
            f"| {np.mean([row['updates'] for row in whole]):.1f} | {said} "
            f"| {100 * np.sqrt((error**2).mean()):.3f} % | {100 * np.median(half):.3f} % | {right} |"
        )
    return "\n".join(lines)


def _z(row: dict[str, Any], key: str) -> float:
    """Error over the standard uncertainty."""
    one = row["said"][key]
    return float((one["value"] - one["truth"]) / one["sigma"])


def main() -> None:
    """Make the shots, run the missing identifications, print the table."""
    parser = command(__doc__)
    parser.add_argument("--population", type=Path, default=POPULATION)
    parser.add_argument("--seed", type=int, help="another population of the same kind")
    parser.add_argument("--shots", type=int, default=12)
    parser.add_argument("--switches", nargs="+", choices=SWITCHES, default=list(SWITCHES))
    parser.add_argument("--table", type=Path, help="where the answers are written, as JSON")
    add_meshes(parser)
    given = parser.parse_args()
    shots = made(argparse.Namespace(**vars(given), right=given.shots, least=0, threads=1))
    jobs = {
        given.out / "jobs" / f"{shot.name}_{name}.json": (shot, name, given.mesh, given.refined_mesh)
        for name in given.switches
        for shot in shots[: given.shots]
    }
    rows = answers(answer, jobs, workers=given.workers)
    if given.table is not None:
        meshes = {"mesh": given.mesh, "refined_mesh": given.refined_mesh}
        write(given.table, {"seed": given.seed, **meshes, "each": rows}, indent=1)
    print(table(rows))


if __name__ == "__main__":
    main()
