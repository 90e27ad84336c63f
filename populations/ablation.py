"""Effect of each mechanism of `identify`: `python -m populations.ablation --out FOLDER --workers N`.

Shots of the population of `populations.wrong_inputs` (each seed gives one population) are identified with all
mechanisms. They are also identified with one mechanism switched off at a time. Search, weights and
uncertainty are tested on correct shots. The first column of their table gives the element updates over those
of 100 runs of the solver's problem. The next gives the errors of m, nu and beta over their standard
uncertainties (root mean square). Then follow the error of m and its uncertainty. The last columns count shots
with a larger error of m than with all mechanisms, shots with every true value within k = 2, and those of them
that are called identified. The diagnosis
is tested on wrong inputs, with one shot for each row of that study. Its table gives the rank of the correct
cause. A mechanism is unnecessary if no result is significantly worse without it.
"""

import argparse
import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.stats import binomtest

from benchmarks.identify import Ledger
from kolsky.identification import identify
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.surrogate_mesh_search import starts
from populations.driver import add_meshes, answers, command, markdown, write
from populations.wrong_input_rows import CURVE, RIGHT, ROWS
from populations.wrong_inputs import POPULATION, Job, attempt, judged, made

NAMES = {"stiffness_factor": "m", "poisson": "nu", "damping": "beta_s"}
"""Free parameters and their keys in truth.json."""
SYMBOLS = {
    "stiffness_factor": "m",
    "poisson": "nu",
    "friction": "f",
    "damping": "beta",
    "prony_strength_1": "strength",
    "prony_time_1": "time",
}
"""Parameters in the order of a table's errors, and their names there."""
Mesh = tuple[int, int]


@dataclass(frozen=True)
class Switch:
    """One mechanism that is switched off."""

    words: str
    """Description of the missing mechanism."""
    target: str = ""
    """Dotted name of the object that is replaced."""
    value: Any = None
    """Its replacement."""
    settings: Callable[[Any], Any] = lambda settings: settings
    """Function that changes the settings (`Settings` or `JointSettings`), for correct shots."""

    def off(self) -> AbstractContextManager[Any]:
        """Context in which the mechanism is off."""
        return patch(self.target, self.value) if self.target else nullcontext()


def _unmoved(runner: Any, objective: Any, slope: Any, last: Any, search: Any) -> Any:
    """Replacement of `follow_on_refined` that returns its input."""
    return last, slope, runner.front


def _with_every_point(runner: Any, start: Any, numerics: Any) -> Any:
    """`starts` with weights that count every point of the outline."""
    points, objective = starts(runner, start, numerics)
    return points, replace(objective, balanced=False)


def _without_path_noise(runner: Any, points: Any, runs: Any, inside: Any) -> Any:
    """`deviance_with_path_noise` for runs with the fitted path only."""
    found = np.full(len(points), np.inf)
    counted = inside & np.all([run.inside[0] for run in runs if run is not None], axis=0)
    objective = runner.objective(counted)
    for row, run in enumerate(runs):
        if run is not None:
            found[row] = objective.balanced_deviance(objective.vectors(run)[:1])[0]
            found[row] += objective.prior_chi2(points[row])
    return found


def _meshes(mesh: Mesh | None = None, refined: Mesh | None = None) -> Callable[[Settings], Settings]:
    """Settings with another mesh of the surrogate or of the answer."""

    def changed(settings: Settings) -> Settings:
        numerics = settings.numerics if mesh is None else settings.numerics.with_mesh(mesh)
        return replace(settings, numerics=numerics, refined_mesh=refined or settings.refined_mesh)

    return changed


OF_SEARCH = {
    "all": Switch("nothing"),
    "one_floor": Switch(
        "all valley floors but the likeliest", "kolsky.inverse.valleys.LIKELY", {"balanced": 1, "force": 0}
    ),
    "balanced": Switch(
        "a frame's points as one value on coarse meshes",
        "kolsky.inverse.surrogate_mesh_search.starts",
        _with_every_point,
    ),
    "path_noise_of_valleys": Switch(
        "the flyer's noise when valleys are compared",
        "kolsky.inverse.valleys.deviance_with_path_noise",
        _without_path_noise,
    ),
    "path_on_coarse": Switch(
        "the path's correction on the surrogate's mesh",
        "kolsky.inverse.surrogate_mesh_search.credible",
        lambda amplitudes: False,
    ),
    "path_on_refined": Switch(
        "the path's correction on the mesh of the steps",
        "kolsky.inverse.gauss_newton.follow_on_refined",
        _unmoved,
    ),
    "half_patterns": Switch("half of the patterns of the path's noise", "kolsky.inverse.runner.PATTERNS", 8),
    "single_precision": Switch(
        "single precision on coarse meshes",
        settings=lambda one: replace(one, numerics=replace(one.numerics, precision="fp64")),
    ),
    "short_steps": Switch(
        "Broyden's slopes of short steps", "kolsky.inverse.surrogate_mesh_search.SHORT", 0.0
    ),
    "given_up": Switch(
        "giving up searches without prospect", "kolsky.inverse.surrogate_mesh_search.GIVE_UP", np.inf
    ),
    "noise_limit": Switch(
        "the noise's limit of a confirming step", "kolsky.inverse.gauss_newton.CONFIRMED_NOISE", np.inf
    ),
    "discrepancy": Switch(
        "the discrepancies in the weights",
        "kolsky.inverse.objective.Objective.with_discrepancy",
        lambda self, vector: self,
    ),
    "halfway": Switch(
        "the coarser graded mesh: all steps on the refined one",
        "kolsky.inverse.problem.InverseProblem.halfway",
        property(lambda self: self.refined),
    ),
    "half_surrogate": Switch(
        "half of the runs of the surrogate about the answer",
        "kolsky.inverse.gauss_newton.RUNS_PER_PARAMETER",
        3,
    ),
    "half_replicates": Switch(
        "half of the curve's draws", settings=lambda settings: replace(settings, replicates=16)
    ),
    "mesh_correction": Switch(
        "the mesh's correction of the answer",
        "kolsky.uncertainty.mesh_error.MeshChange.correction",
        lambda self, gain: np.zeros(len(gain)),
    ),
    "coarser_refined": Switch("a refined mesh of 48 x 64: 40 x 54", settings=_meshes(refined=(40, 54))),
    "finer_refined": Switch("nothing; a refined mesh of 64 x 86", settings=_meshes(refined=(64, 86))),
    "coarser_surrogate": Switch("a surrogate's mesh of 20 x 27: 18 x 24", settings=_meshes((18, 24))),
    "finer_surrogate": Switch("nothing; a surrogate's mesh of 24 x 32", settings=_meshes((24, 32))),
    "held": Switch(
        "nothing; the stiffness factor alone is free",
        settings=lambda settings: replace(settings, free={"stiffness_factor": None}),
    ),
}
"""Switches that are tested on correct shots."""
OF_DIAGNOSIS = {
    "nothing_of_diagnosis": Switch("nothing"),
    "screen": Switch(
        "the coarser mesh for large changes",
        "kolsky.diagnosis.cause_model.CauseModel.screen",
        property(lambda self: self),
    ),
    "large_changes": Switch(
        "large changes of an input", "kolsky.diagnosis.causes.scan_inputs", lambda *_: []
    ),
    "freed_poisson": Switch(
        "the search of the valleys of a held Poisson's ratio",
        "kolsky.diagnosis.causes._freed_poisson",
        lambda *_: [],
    ),
    "contenders": Switch(
        "runs on the refined mesh for inputs that are alike",
        "kolsky.diagnosis.causes._contenders",
        lambda *_: [],
    ),
    "second_start": Switch("the second start", "kolsky.inverse.search.Search.held_run", lambda self: None),
    "beside_leading": Switch(
        "a second wrong input beside the first",
        "kolsky.diagnosis.causes._search_beside_leading",
        lambda first, judge, findings, rest: findings,
    ),
    "suspects": Switch(
        "suspects of an explained answer",
        "kolsky.diagnosis.causes.with_suspects",
        lambda causes, *_: tuple(causes),
    ),
    "leading": Switch(
        "leading inputs of a withheld answer",
        "kolsky.diagnosis.causes.with_leading",
        lambda causes, at_bound: tuple(causes),
    ),
}
"""Switches that are tested on wrong inputs."""
OF_JOINT = {
    "scatter": Switch(
        "the scatter between the shots", settings=lambda settings: replace(settings, scatter=False)
    ),
    "refined_patterns": Switch(
        "the patterns of the path's noise on a graded mesh",
        "kolsky.inverse.joint_search.with_refined_patterns",
        lambda problem, found: found,
    ),
    "coarse_slopes": Switch(
        "slopes of the search's mesh on the refined one", "kolsky.inverse.joint_search.COARSE_SLOPE_RUNS", 1
    ),
    "one_valley": Switch("all valleys but the likeliest", "kolsky.inverse.joint_search.MOST_VALLEYS", 1),
    "half_times": Switch("half of the times of the scan", "kolsky.inverse.joint_search.TIME_LEVELS", 3),
}
"""Switches that are tested on several shots, by `populations.joint_coverage --off`."""
OF_PICTURES = {
    "slow_correlations": Switch(
        "longer steps of slow correlations", "dic.correlation.kernels.search.SLOWEST", 0.0
    ),
    "way_left": Switch("way left of fast correlations", "dic.correlation.kernels.search.SHRUNK", 0.0),
}
"""Switches that are tested on pictures, by `populations.forty --off`."""
SWITCHES = OF_SEARCH | OF_DIAGNOSIS | OF_JOINT | OF_PICTURES


def answer(shot: Path, name: str, device: str, mesh: Mesh, refined: Mesh) -> dict[str, Any]:
    """One identification of a correct shot with a mechanism switched off."""
    switch, truth = SWITCHES[name], json.loads((shot / "truth.json").read_text("utf-8"))
    numerics = Numerics(mesh=mesh, device=device, threads=1)
    settings = switch.settings(Settings(numerics=numerics, refined_mesh=refined))
    ledger = Ledger()
    try:
        with switch.off(), ledger.watching():
            found = identify(shot, settings)
    except ValueError as error:
        return {"shot": shot.name, "switch": name, "broke": str(error)}
    said = {
        key: {"value": e.value, "sigma": e.sigma, "truth": truth[NAMES[key]], "outcome": e.outcome.value}
        for key, e in found.estimates.items()
    }
    return {
        "shot": shot.name,
        "switch": name,
        "updates": ledger.updates,
        "said": said,
        "identified": found.estimates["stiffness_factor"].outcome.identified,
        "causes": [cause.key for cause in found.causes if cause.named],
    }


def diagnose(job: Job, name: str) -> dict[str, Any]:
    """One identification of a wrong input with a mechanism switched off."""
    ledger = Ledger()
    with SWITCHES[name].off(), ledger.watching():
        said = attempt(job)
    row = next(row for row in ROWS if row.name == job.row)
    return {
        "shot": job.shot.name,
        "switch": name,
        "row": job.row,
        "updates": ledger.updates,
        **({"broke": said["broke"]} if "broke" in said else {"end": judged(row, said)}),
    }


def _chance(worse: int, of: int) -> str:
    """Text: probability of at least this count if both sides are equally likely."""
    return f"{binomtest(worse, of, alternative='greater').pvalue:.2g}" if of else "-"


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown table with one row for each switch that is tested on correct shots."""
    keys = [key for key in SYMBOLS if any(key in row.get("said", {}) for row in rows)]
    words = f"error over u: {', '.join(SYMBOLS[key] for key in keys)}"
    heads = ("off", "shots", "updates", words, "error of m", "U of m", "larger error", "inside", "right")
    lines: list[tuple[Any, ...]] = []
    errors: dict[str, dict[str, float]] = {}
    for name, switch in (OF_SEARCH | OF_JOINT).items():
        mine = [row for row in rows if row["switch"] == name]
        whole = [row for row in mine if "broke" not in row]
        if not whole:
            continue
        z = {key: np.array([_z(row, key) for row in whole if key in row["said"]]) for key in keys}
        m = [row["said"]["stiffness_factor"] for row in whole]
        error = np.array([one["value"] / one["truth"] - 1.0 for one in m])
        errors[name] = dict(zip([row["shot"] for row in whole], np.abs(error).tolist(), strict=True))
        pairs = [(errors[name][k], errors["all"][k]) for k in errors[name] if k in errors.get("all", {})]
        unequal = [(a, b) for a, b in pairs if abs(a - b) > ROUNDING]
        worse = sum(a > b for a, b in unequal)
        inside = [all(abs(_z(row, key)) <= 2.0 for key in row["said"]) for row in whole]
        right = sum(held and row["identified"] for held, row in zip(inside, whole, strict=True))
        said = ", ".join(f"{np.sqrt((z[key] ** 2).mean()):.2f}" if len(z[key]) else "-" for key in keys)
        percent = f"{100 * np.sqrt((error**2).mean()):.3f} %"
        U = f"{200 * np.median([one['sigma'] / one['truth'] for one in m]):.3f} %"
        larger = f"{worse} of {len(unequal)} ({_chance(worse, len(unequal))})"
        lines.append((switch.words, len(mine), _updates(whole), said, percent, U, larger, sum(inside), right))
    return markdown(heads, lines)


ROUNDING = 1e-6
"""Relative change of m below which two answers are equal [-]: a hundredth of the smallest uncertainty."""
SIDES = ("first", "refused")
"""Outcomes of a wrong input with the correct cause first."""


def diagnosis_table(rows: list[dict[str, Any]]) -> str:
    """Markdown table with one row for each switch that is tested on wrong inputs."""
    lines = []
    ends: dict[str, dict[str, str]] = {}
    for name, switch in OF_DIAGNOSIS.items():
        mine = [row for row in rows if row["switch"] == name and "end" in row]
        if not mine:
            continue
        ends[name] = {row["row"]: row["end"] for row in mine}
        counted = [end for end in ends[name].values() if end != "harmless"]
        first = sum(end in SIDES for end in counted)
        base = ends.get("nothing_of_diagnosis", {})
        both = [(base[k] in SIDES, end in SIDES) for k, end in ends[name].items() if k in base]
        lost, gained = both.count((True, False)), both.count((False, True))
        ranks = (f"{first} of {len(counted)}", first + counted.count("second"), counted.count("confident"))
        lines.append((switch.words, len(mine), _updates(mine), *ranks, f"{lost}, {gained}"))
    heads = ("off", "rows", "updates", "first", "first two", "confident", "lost, gained")
    return markdown(heads, lines)


def _updates(rows: list[dict[str, Any]]) -> str:
    return f"{np.mean([row['updates'] for row in rows]):.1f}"


def _z(row: dict[str, Any], key: str) -> float:
    """Error over the standard uncertainty."""
    one = row["said"][key]
    return float((one["value"] - one["truth"]) / one["sigma"])


def main() -> None:
    """Make the shots, run the missing identifications, print the tables."""
    parser = command(__doc__)
    parser.add_argument("--population", type=Path, default=POPULATION)
    parser.add_argument("--seed", type=int, help="another population of the same kind")
    parser.add_argument("--shots", type=int, default=12)
    parser.add_argument("--switches", nargs="+", choices=SWITCHES, default=list(SWITCHES))
    parser.add_argument("--table", type=Path, help="where the answers are written, as JSON")
    add_meshes(parser)
    given = parser.parse_args()
    shots = made(argparse.Namespace(**vars(given), right=given.shots, least=0, threads=1))[: given.shots]
    wrong = [row for row in ROWS if not row.name.startswith(RIGHT) and row.name != CURVE]
    place, meshes = given.out / "jobs", (given.mesh, given.refined_mesh)
    right = {
        place / f"{shot.name}_{name}.json": (shot, name, given.device, *meshes)
        for name in given.switches
        for shot in shots
        if name in OF_SEARCH
    }
    others = {}
    for name in given.switches:
        for i, row in enumerate(wrong if name in OF_DIAGNOSIS else ()):
            job = Job(row.name, shots[i % len(shots)], given.device, 1, meshes)
            others[place / f"{job.file(given.out).stem}_{name}.json"] = (job, name)
    rows = answers(answer, right, workers=given.workers) + answers(diagnose, others, workers=given.workers)
    if given.table is not None:
        head = {"seed": given.seed, "mesh": given.mesh, "refined_mesh": given.refined_mesh}
        write(given.table, {**head, "each": rows}, indent=1)
    print(f"{table(rows)}\n\n{diagnosis_table(rows)}")


if __name__ == "__main__":
    main()
