"""Coverage of the intervals of single shots: `python -m populations.coverage --out FOLDER`.

`kolsky.identification.identify` identifies every experiment from its noisy force, outline, flyer and curve,
as in a laboratory. The study counts how often the k = 2 interval contains the true value. The folder stores
one file for each answer; a folder next to it stores the truths.
"""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom, binomtest

from benchmarks.identify import Ledger
from kolsky.identification import identify
from kolsky.inverse.result import Verdict
from populations import coverage_problem as problem
from populations import driver
from populations.ablation import OF_SEARCH

PARAMETERS = {
    "m": "stiffness_factor",
    "f": "friction",
    "beta": "damping",
    "nu": "poisson",
    **{name: name for name in ("stiffness_factor", "friction", "damping", "poisson")},
}


@dataclass(frozen=True, kw_only=True)
class Study(driver.TruthStudy):
    """Settings of a study. A truth is the mean of both elements on its mesh, see `TRUTH_GRADING`."""

    free: tuple[str, ...]
    """Free parameters; the others are held at their true values."""
    truth_mesh: tuple[int, int] = (128, 172)
    surface: str = ""
    """Contact law of faces and side. Empty: coulomb if the friction is free, otherwise bonded."""
    off: str = "all"
    """Mechanism that is switched off, a name of `populations.ablation.OF_SEARCH`; "all": none."""

    def __post_init__(self) -> None:
        finest = max(self.mesh[0], self.refined_mesh[0])
        if self.truth_mesh[0] < 1.5 * finest:
            raise ValueError(
                f"the truth's mesh has {self.truth_mesh[0]} elements across the radius, must have 1.5 times "
                f"the {finest} of the identification: a truth as coarse as the answer flatters it"
            )

    @property
    def interface(self) -> str:
        """Contact law of faces and side."""
        return self.surface or (problem.SLIDING if "friction" in self.free else problem.BONDED)


def answer(study: Study, folder: Path, number: int) -> dict[str, Any]:
    """Identify one experiment whose truth is stored.

    `sigma` is the combined standard uncertainty, `correction` the extrapolation to an infinitely fine mesh,
    `parts` the standard uncertainties by source, `routes` value and standard uncertainty from the force only
    and from the outline only, `profile` the 95 % interval of the profile likelihood on the refined mesh,
    `outcome` the verdicts or the reason for a missing answer, whose numbers are NaN, `figures` the results of
    the search, and `updates` its element updates over those of the solver's problem.
    """
    started = time.perf_counter()
    setup, truth = problem.drawn(number, study.seed)
    with np.load(truth_file(study, folder, number)) as stored:
        seen = stored["force"], stored["Z"]
    rng = np.random.default_rng([study.seed, 1, number])
    shot = problem.experiment(number, setup, truth, seen, study.interface, rng)
    asked = driver.settings(study, free=dict.fromkeys(study.free), seed=study.seed + number)
    said: dict[str, Any] = {
        "number": number,
        "truth": {name: float(getattr(truth, name)) for name in study.free},
        **{key: dict.fromkeys(study.free, float("nan")) for key in ("value", "sigma", "correction")},
        "parts": {name: {} for name in study.free},
        "routes": {},
        "profile": {},
        "warnings": [],
        "figures": {},
    }
    switch, ledger = OF_SEARCH[study.off], Ledger()
    try:
        with switch.off(), ledger.watching():
            result = identify(shot, switch.settings(asked))
    except ValueError as error:
        return {**said, "outcome": str(error), "seconds": time.perf_counter() - started}
    e = result.estimates
    return {
        **said,
        "value": {name: e[name].value for name in study.free},
        "sigma": {name: e[name].sigma for name in study.free},
        "correction": {name: e[name].mesh_correction for name in study.free},
        "parts": {name: {**e[name].noise_parts, **e[name].numerical_parts} for name in study.free},
        "routes": {
            route.name: {name: [route.parameters[name], route.sigma[name]] for name in study.free}
            for route in result.routes
            if route.sigma
        },
        "profile": {profile.name: list(profile.interval) for profile in result.profiles},
        "outcome": "; ".join(sorted({estimate.outcome.value for estimate in e.values()})),
        "warnings": list(result.warnings),
        "figures": dict(result.surrogate),
        "updates": ledger.updates,
        "seconds": time.perf_counter() - started,
    }


def make_truths(study: Study, folder: Path, numbers: list[int]) -> str:
    """Simulate and store the exact force and outline of some experiments of one group."""
    started = time.perf_counter()
    pairs = [problem.drawn(number, study.seed) for number in numbers]
    one, other = (
        problem.simulate(
            pairs[0][0],
            [truth for _, truth in pairs],
            mesh=study.truth_mesh,
            device=study.truth_device,
            element=element,
            interface=study.interface,
            grading=problem.TRUTH_GRADING,
        )
        for element in problem.TRUTH_ELEMENTS
    )
    seen = [problem.middle(*both) for both in zip(one, other, strict=True)]
    for number, (force, Z) in zip(numbers, seen, strict=True):
        place = truth_file(study, folder, number)
        place.parent.mkdir(parents=True, exist_ok=True)
        partial = place.with_suffix(".part.npz")
        np.savez_compressed(partial, force=force, Z=Z)
        partial.replace(place)
    return f"truths {numbers[0]} to {numbers[-1]}: {time.perf_counter() - started:.0f} s"


def line(one: dict[str, Any]) -> str:
    """One line of text for an answer."""
    errors = ", ".join(
        f"{name} {one['value'][name] - true:+.2g} ({2.0 * one['sigma'][name]:.2g})"
        for name, true in one["truth"].items()
    )
    return f"experiment {one['number']}: {errors}; {one['outcome']}; {one['seconds']:.0f} s"


def answer_file(folder: Path, number: int) -> Path:
    """File of an answer."""
    return folder / f"answer-{number:04d}.json"


def truth_file(study: Study, folder: Path, number: int) -> Path:
    """File of a truth. Truths depend on the interface but not on the free parameters, so studies in one
    folder share them."""
    mesh = "x".join(map(str, study.truth_mesh))
    return folder.parent / f"truths-{study.seed}-{mesh}-both-{study.interface}" / f"truth-{number:04d}.npz"


def run(
    study: Study, folder: Path, numbers: Sequence[int], *, workers: int, truths_only: bool = False
) -> list[dict[str, Any]]:
    """Answers of the experiments in order. With `truths_only` only the missing truths are made, and no answer
    is returned."""
    driver.hold(study, folder)
    missing = [
        n for n in numbers
        if not (answer_file(folder, n).exists() or truth_file(study, folder, n).exists())
    ]  # fmt: skip
    groups = [
        (study, folder, list(group)) for _, group in groupby(sorted(missing), lambda n: n // problem.GROUP)
    ]
    for words in driver.results(make_truths, groups, workers):
        print(words, flush=True)
    if truths_only:
        return []
    jobs = {answer_file(folder, n): (study, folder, n) for n in numbers}
    return driver.answers(answer, jobs, workers=workers, line=line)


NOMINAL = 0.9545
"""Probability of an interval of k = 2 of a normal distribution."""
WANTED = (0.92, 0.98)
"""Required range of the coverage in a study of 200 experiments."""
LARGEST_MEAN = 0.25
"""Required limit of the mean error over the mean standard uncertainty."""

ANSWERS = frozenset(verdict.value for verdict in Verdict if verdict.identified)
"""Verdicts that report a value as an answer."""

UNITS = {"damping": (1e6, "µs")}
"""Factor and unit of parameters that are not shown in SI units."""
SYMBOLS = {"stiffness_factor": "$m$", "poisson": "$\\nu$", "damping": "$\\beta$", "friction": "$f$"}

Each = list[dict[str, Any]]
"""Answers, see `answer`."""


def summary(each: Each) -> dict[str, Any]:
    """Coverage, errors and standard uncertainties of each parameter. A missing answer counts as not
    covering."""
    n = len(each)
    low, high = binom.interval(0.95, n, NOMINAL)
    outcomes = sorted({one["outcome"] for one in each})
    return {
        "experiments": n,
        "exact interval, 95 % of studies": [low / n, high / n],
        "outcomes": {text: sum(one["outcome"] == text for one in each) for text in outcomes},
        "with a warning that force and outline disagree": sum(
            any("outline disagree" in text for text in one.get("warnings", [])) for one in each
        ),
        "called identified": sum(called_identified(one) for one in each),
        **{name: _parameter(name, each) for name in each[0]["truth"]},
    }


def called_identified(one: dict[str, Any]) -> bool:
    """True if every verdict of an experiment is an answer, also if it is based on one channel only."""
    return all(text in ANSWERS for text in one["outcome"].split("; "))


def _parameter(name: str, each: Each) -> dict[str, Any]:
    good = [one for one in each if np.isfinite(one["value"][name])]
    error = np.array([one["value"][name] - one["truth"][name] for one in good])
    sigma = np.array([one["sigma"][name] for one in good])
    correction = np.array([one["correction"][name] for one in good])
    parts = [one["parts"][name] for one in good]
    sources = sorted({source for part in parts for source in part})
    held = int((np.abs(error) <= 2.0 * sigma).sum())
    share, mean = held / len(each), float(error.mean())
    misses = {"above": int((error > 2.0 * sigma).sum()), "below": int((error < -2.0 * sigma).sum())}
    # If both sides are equally likely, all n misses are on one side with probability 1 / 2^(n - 1).
    lopsided = binomtest(misses["above"], max(sum(misses.values()), 1)).pvalue < 0.05
    within = [  # an open end is NaN, and comparisons with NaN are false
        not (one["truth"][name] < one["profile"][name][0] or one["truth"][name] > one["profile"][name][1])
        for one in good
        if name in one["profile"]
    ]
    answered = [one for one in good if called_identified(one)]
    inside = sum(abs(one["value"][name] - one["truth"][name]) <= 2.0 * one["sigma"][name] for one in answered)
    low, high = binom.interval(0.95, len(answered), NOMINAL) if answered else (0, 0)
    return {
        "covered": share,
        "covered of those called identified": inside / len(answered) if answered else None,
        "exact interval of those, 95 % of studies": (
            [low / len(answered), high / len(answered)] if answered else None
        ),
        "answers": len(good),
        "misses, value too high and too low": misses,
        "mean error": mean,
        "standard error of it": float(error.std(ddof=1) / np.sqrt(len(good))) if len(good) > 1 else None,
        "scatter": float(error.std(ddof=1)) if len(good) > 1 else None,
        "mean error without the mesh correction": float((error - correction).mean()),
        "mean correction": float(correction.mean()),
        "mean sigma": float(sigma.mean()),
        "mean parts": {source: float(np.mean([p.get(source, 0.0) for p in parts])) for source in sources},
        "error over sigma, mean and standard deviation": [
            float((error / sigma).mean()),
            float((error / sigma).std(ddof=1)) if len(good) > 1 else None,
        ],
        "covered by force alone and outline alone": _routes(name, good),
        "covered by the profile likelihood alone": float(np.mean(within)) if within else None,
        "as wanted": {
            "covered 92 to 98 %": WANTED[0] <= share <= WANTED[1],
            "mean error below a quarter of sigma": abs(mean) < LARGEST_MEAN * float(sigma.mean()),
            "misses on both sides": not lopsided,
        },
    }


def _routes(name: str, good: Each) -> dict[str, float]:
    """How often the k = 2 interval of each channel contains the true value."""
    found = {}
    for route in ("force only", "shape only"):
        pairs = [(one["routes"][route][name], one["truth"][name]) for one in good if route in one["routes"]]
        if pairs:
            found[route] = float(
                np.mean([abs(value - true) <= 2.0 * sigma for (value, sigma), true in pairs])
            )
    return found


def table(said: dict[str, Any]) -> str:
    """One study as a Markdown table with one column for each parameter."""
    names = said["study"]["free"]
    n, (low, high) = said["experiments"], said["exact interval, 95 % of studies"]
    exact, misses = f"{100 * low:.1f} to {100 * high:.1f} %", "misses: too high, too low"
    heads = [SYMBOLS[name] + (f" ({UNITS[name][1]})" if name in UNITS else "") for name in names]
    rows: list[tuple[str, list[str]]] = [
        (f"intervals that hold the truth, of {n}", [f"{100 * said[p]['covered']:.1f} %" for p in names]),
        ("what an exact interval does in 95 % of studies", [exact] * len(names)),
        (
            f"of the {said.get('called identified', '–')} that are called identified",
            [_answered(said[p]) for p in names],
        ),
        (misses, ["{above}, {below}".format(**said[p]["misses, value too high and too low"]) for p in names]),
    ]
    rows += [
        (words, [_shown(p, said[p][key]) for p in names])
        for words, key in (
            ("mean error", "mean error"),
            ("standard error of it", "standard error of it"),
            ("mean error without the mesh correction", "mean error without the mesh correction"),
            ("scatter of the answers", "scatter"),
            ("mean standard uncertainty", "mean sigma"),
        )
    ]
    sources = sorted({source for p in names for source in said[p]["mean parts"]})
    rows += [
        (f"of it: {source}", [_shown(p, said[p]["mean parts"].get(source, 0.0)) for p in names])
        for source in sources
    ]
    rows += [
        (f"covered by the {words} alone", [_route(said[p], route) for p in names])
        for words, route in (("force", "force only"), ("outline", "shape only"))
    ]
    return driver.markdown(["", *heads], ([words, *cells] for words, cells in rows))


def _answered(one: dict[str, Any]) -> str:
    """Share of the answers that contain the true value, with the range that exact intervals give in 95 % of
    studies."""
    share = one.get("covered of those called identified")
    if share is None:
        return "–"
    low, high = one["exact interval of those, 95 % of studies"]
    return f"{100 * share:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


def _route(one: dict[str, Any], route: str) -> str:
    share = one["covered by force alone and outline alone"].get(route)
    return "–" if share is None else f"{100 * share:.1f} %"


def _shown(name: str, value: float | None) -> str:
    if value is None:
        return "–"
    text = f"{value * UNITS.get(name, (1.0, ''))[0]:.2g}"
    return text.replace("-", "−")


def main() -> None:
    """Run or continue a study and write its summary."""
    parser = driver.command(__doc__, seed=1, table=table)
    driver.add_meshes(parser, truth=Study.truth_mesh)
    parser.add_argument(
        "--free", type=_free, default=("stiffness_factor",), help="m, or m,beta or m,poisson,beta or m,f,beta"
    )
    words = "contact law of faces and side; coulomb where the friction is free, else bonded"
    parser.add_argument("--surface", choices=problem.SURFACES, default="", help=words)
    parser.add_argument("--off", choices=OF_SEARCH, default="all", help="mechanism that is switched off")
    parser.add_argument("--experiments", type=int, default=200)
    parser.add_argument("--rows", type=driver.numbers, help="FIRST:STOP, a part of the experiments")
    parser.add_argument("--truths", action="store_true", help="make the truths, identify nothing")
    given = parser.parse_args()
    study = Study.of(given)
    started = time.perf_counter()
    rows = given.rows or range(given.experiments)
    each = run(study, given.out, rows, workers=given.workers, truths_only=given.truths)
    if given.truths:
        return
    seconds = {
        "this call": time.perf_counter() - started,
        "each": float(np.mean([e["seconds"] for e in each])),
    }
    whole = {**driver.about(study, given), "seconds": seconds, **summary(each)}
    print(json.dumps(whole, indent=2))
    driver.write(given.out / "summary.json", {**whole, "each": each}, indent=1)


def _free(text: str) -> tuple[str, ...]:
    """Parameters from their names or symbols; SystemExit for an unknown or repeated one."""
    unknown = [name for name in text.split(",") if name not in PARAMETERS]
    found = tuple(PARAMETERS[name] for name in text.split(",") if name in PARAMETERS)
    if unknown or len(set(found)) < len(found):
        raise SystemExit(f"--free {text}: each of {', '.join(PARAMETERS)} at most once, with commas between")
    return found


if __name__ == "__main__":
    main()
