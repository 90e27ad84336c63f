"""Sets of three viscoelastic shots and a relaxation test: `python -m populations.joint_coverage --out
FOLDER`.

Each draw is one material (m, strength, time, Poisson's ratio, damping) with three shots and a relaxation
test. The virtual laboratory makes the shots with one quasi-static curve and random speeds between 1.2 and 3.5
m/s. `identify_shots` identifies them with all parameters free and decides whether the data require
relaxation. With --elastic the same materials are elastic and are identified in the same way. The study counts
three results: the 95 % interval contains the true value; strength and time are both within two standard
uncertainties; relaxation is required. The folder stores every answer, so an interrupted study can be
continued.

Processes share all GPUs. With --truth-device cuda the truths run in parallel on them; each GPU has a part of
the shots. An answer takes some minutes on one core of a CPU (--device cpu).
"""

import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.identify import Ledger
from explicit.relaxation import PronySeries
from kolsky.inverse.parameters import with_relaxation
from kolsky.inverse.settings import JointSettings
from kolsky.joint_identification import identify_shots
from kolsky.material.relaxation.rate_fit import HistoryTest, RateModel
from kolsky.results.joint import to_json
from kolsky.shot.load import load_shot
from kolsky.virtual.make import Place, make_places, place_of
from kolsky.virtual.material import law_of
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import read_specification
from populations import driver
from populations.ablation import OF_JOINT, OF_SEARCH
from populations.coverage import ANSWERS, Each

SWITCHES = OF_SEARCH | OF_JOINT
SHOTS = 3
SLOW_SIGMA = 50.0
"""Noise of the relaxation test [Pa]: 0.5 % of its stress."""
SPECIFICATION = """format = 1
name = "draw"
seed = {seed}
[material]
stiffness_factor = {stiffness_factor:.9g}
poisson = {poisson:.9g}
damping = "{damping:.9g} s"
[motion]
compression = "40 %"
[truth]
mesh = [{across}, {along}]
grading = {grading:.9g}
element = "{element}"
{relaxation}
[population]
shots = {shots}
[population.draw]
"motion.speed" = {{ low = "1.2 m/s", high = "3.5 m/s" }}
"""
RELAXATION = """[relaxation]
kind = "prony"
free = true
strengths = [{prony_strength_1:.9g}]
times = ["{prony_time_1:.9g} s"]
"""


@dataclass(frozen=True, kw_only=True)
class Study(driver.TruthStudy):
    """Settings of a study. Studies with equal settings have the same draws and the same answers."""

    elastic: bool = False
    """Whether the materials are elastic."""
    slow: bool = True
    """Whether a relaxation test is added to the shots."""
    mesh: tuple[int, int] = (24, 32)
    refined_mesh: tuple[int, int] = (64, 86)
    truth_grading: float = 5.0
    """Ratio of the largest to the smallest element of this mesh. The small elements are at the faces' edges.
    A uniform mesh with the same number of elements has twice the error (docs/validation/coverage.md)."""
    truth_element: str = "middle"
    """Element of the truth: F-bar elements alone have an error as large as the uncertainty of three shots."""
    off: str = "all"
    """Mechanism that is switched off, a name of `SWITCHES`; "all": none."""


def truth(study: Study, number: int) -> dict[str, float]:
    """The material of a draw."""
    rng = np.random.default_rng([study.seed, number])
    return {
        "stiffness_factor": float(rng.uniform(0.9, 1.4)),
        "poisson": float(0.5 - 0.5 * np.exp(rng.uniform(np.log(1.6e-3), np.log(6e-3)))),
        "damping": float(rng.uniform(15e-6, 35e-6)),
        "prony_strength_1": float(np.exp(rng.uniform(np.log(0.15), np.log(0.8)))),
        "prony_time_1": float(np.exp(rng.uniform(np.log(1e-4), np.log(1.2e-3)))),
    }


def make_truths(study: Study, folder: Path, numbers: Sequence[int], workers: int) -> None:
    """Make the shots of all draws. On GPUs their simulations run in parallel. The shots of a draw share one
    quasi-static curve."""
    places = [place for number in numbers for place in specified(study, folder, number)]
    threads = 1 if study.truth_device == "cpu" else None
    make_places(places, device=study.truth_device, threads=threads, workers=workers)
    for number in numbers:
        folders = [place for _, place in specified(study, folder, number)]
        for other in folders[1:]:  # one material has one quasi-static curve
            shutil.copy(folders[0] / "quasi_static.csv", other / "quasi_static.csv")


def specified(study: Study, folder: Path, number: int) -> list[Place]:
    """The shots of a draw and their folders."""
    true, place = truth(study, number), folder / f"draw-{number:03d}"
    place.mkdir(parents=True, exist_ok=True)
    relaxation = "" if study.elastic else RELAXATION.format(**true)
    across, along = study.truth_mesh
    text = SPECIFICATION.format(
        **true,
        seed=1000 * study.seed + number,
        across=across,
        along=along,
        grading=study.truth_grading,
        element=study.truth_element,
        relaxation=relaxation,
        shots=SHOTS,
    )
    (place / "SPEC.toml").write_text(text)
    series = read_specification(place / "SPEC.toml")
    shots = [series.shot(k) for k in series.numbers]
    return [(shot, place_of(series, shot, place / "shots")) for shot in shots]


def answer(study: Study, folder: Path, number: int) -> dict[str, Any]:
    """Identify a draw's shots together."""
    started, true, place = time.perf_counter(), truth(study, number), folder / f"draw-{number:03d}"
    folders = sorted((place / "shots").glob("*/shot.toml"))
    # The start of the search does not depend on the truth.
    shots = [replace(with_relaxation(load_shot(one), "prony"), name=one.parent.name) for one in folders]
    asked = driver.settings(study, JointSettings, seed=study.seed + number)
    said: dict[str, Any] = {"number": number, "truth": true, "elastic": study.elastic}
    switch, ledger = SWITCHES[study.off], Ledger()
    try:
        slow = (relaxation_test(study, true, number),) if study.slow else ()
        with switch.off(), ledger.watching():
            found = identify_shots(shots, switch.settings(asked), slow=slow, ledger=place / "joint.sqlite")
        said |= {"found": to_json(found), "error": "", "updates": ledger.updates}
    except ValueError as error:
        said |= {"found": None, "error": str(error)}
    said["seconds"] = time.perf_counter() - started
    return said


def line(one: dict[str, Any]) -> str:
    """One line of text for an answer."""
    outcome = one["error"] or one["found"]["model_choice"]["sentence"]
    return f"draw {one['number']}: {outcome}; {one['seconds']:.0f} s"


def relaxation_test(study: Study, true: dict[str, float], number: int) -> HistoryTest:
    """Relaxation test of the true law with noise: 20 % compression within 50 us, held for one second."""
    times = np.geomspace(1e-4, 1.0, 40)
    test = HistoryTest.relaxation(times, np.zeros(40), SLOW_SIGMA, stretch=0.8, rise=5e-5)
    series = PronySeries((), ())
    if not study.elastic:
        series = PronySeries((true["prony_strength_1"],), (true["prony_time_1"],))
    material = Specification().material
    law = law_of(material.law, material.parameters, material.shear_modulus)
    clean = test.predict(law, [RateModel(true["stiffness_factor"], series)])[0]
    noise = np.random.default_rng([study.seed, number, 7]).standard_normal(len(clean))
    return replace(test, stress=clean + SLOW_SIGMA * noise, label="relaxation")


PAIR = ("prony_strength_1", "prony_time_1")
NAMES = ("stiffness_factor", "poisson", "damping", *PAIR)
SYMBOLS = {
    "stiffness_factor": "$m$",
    "poisson": "$\\nu$",
    "damping": "$\\beta$",
    "prony_strength_1": "strength",
    "prony_time_1": "time",
}


def summary(each: Each) -> dict[str, Any]:
    """Counts of covered truths, correct pairs and required relaxation, and a short form of every draw. A
    rejected draw counts as not covering and without relaxation."""
    answered = [one for one in each if one["found"] is not None]
    choices = [one["found"]["model_choice"] for one in answered]
    verdicts = [{e["outcome"] for e in one["found"]["estimates"].values()} for one in answered]
    return {
        "draws": len(each),
        "answered": len(answered),
        "relaxation asked for": driver.share(sum(choice["asked_for"] for choice in choices), len(each)),
        "pairs within 2 sigma": driver.share(sum(pair_found(one) for one in answered), len(each)),
        "called identified": sum(said <= ANSWERS for said in verdicts),
        **{name: _parameter(name, answered, len(each)) for name in NAMES},
        "each": [_short(one) for one in each],
    }


def _parameter(name: str, answered: Each, of: int) -> dict[str, Any]:
    rows = [(one["truth"][name], one["found"]["estimates"][name]) for one in answered]
    inside = sum(e["interval_95"][0] <= true <= e["interval_95"][1] for true, e in rows)
    errors = np.array([(e["value"] - true) / e["sigma"] for true, e in rows])
    widths = [0.5 * (e["interval_95"][1] - e["interval_95"][0]) / true for true, e in rows]
    return {
        "held": driver.share(inside, of),
        "misses, value too high and too low": [
            sum(true < e["interval_95"][0] for true, e in rows),
            sum(true > e["interval_95"][1] for true, e in rows),
        ],
        "error over sigma, mean and root mean square": (
            [float(errors.mean()), float(np.sqrt((errors**2).mean()))] if rows else None
        ),
        "median half width over the truth": float(np.median(widths)) if rows else None,
    }


def pair_found(one: dict[str, Any]) -> bool:
    """Whether strength and time are both within two standard uncertainties of the truth."""
    found, true = one["found"]["estimates"], one["truth"]
    return all(abs(found[name]["value"] - true[name]) <= 2.0 * found[name]["sigma"] for name in PAIR)


def _short(one: dict[str, Any]) -> dict[str, Any]:
    """A draw without the data of its shots and tables."""
    found = one["found"]
    said = {"number": one["number"], "seconds": one["seconds"], "error": one["error"], "truth": one["truth"]}
    if found is None:
        return said
    kept, why = ("value", "sigma", "interval_95", "outcome"), ("aic", "probability", "asked_for", "sentence")
    return {
        **said,
        "estimates": {n: {key: e[key] for key in kept} for n, e in found["estimates"].items()},
        "scatter": found["scatter_between_shots"],
        "choice": {key: found["model_choice"][key] for key in why},
    }


def table(said: dict[str, Any]) -> str:
    """A study's `summary.json` as Markdown: the counts, and one column for each parameter."""
    study, asked = said["study"], said["relaxation asked for"]
    head = (
        f"{said['draws']} draws of seed {study['seed']} ({driver.on_meshes(study)}), "
        f"{said['answered']} answered. Relaxation asked for: "
        f"{driver.counted(asked)}."
    )
    names = NAMES[: -len(PAIR)] if study["elastic"] else NAMES  # elastic materials have no pair
    if not study["elastic"]:
        head += (
            " Strength and time both within two standard uncertainties: "
            f"{driver.counted(said['pairs within 2 sigma'])}. Called identified: {said['called identified']}."
        )
    rows = [
        ("95 % intervals that hold the truth", [driver.counted(said[name]["held"]) for name in names]),
        (
            "misses: too high, too low",
            [", ".join(map(str, said[name]["misses, value too high and too low"])) for name in names],
        ),
        ("error over standard uncertainty: mean, rms", [_errors(said[name]) for name in names]),
        ("median half width of the interval", [_width(said[name]) for name in names]),
    ]
    heads = ["", *(SYMBOLS[name] for name in names)]
    return f"{head}\n\n{driver.markdown(heads, ([words, *cells] for words, cells in rows))}"


def _errors(one: dict[str, Any]) -> str:
    both = one["error over sigma, mean and root mean square"]
    return "–" if both is None else f"{both[0]:+.2f}, {both[1]:.2f}".replace("-", "−")


def _width(one: dict[str, Any]) -> str:
    width = one["median half width over the truth"]
    return "–" if width is None else f"{100.0 * width:.2g} %"


def main() -> None:
    """Run or continue a study and write its summary."""
    parser = driver.command(__doc__, seed=1, table=table)
    driver.add_meshes(parser, truth=Study.truth_mesh)
    parser.add_argument("--off", choices=SWITCHES, default="all", help="mechanism that is switched off")
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--rows", type=driver.numbers, help="FIRST:STOP, a part of the draws")
    parser.add_argument("--elastic", action="store_true", help="nothing relaxes: the control")
    parser.add_argument("--without-slow", action="store_true", help="the shots alone")
    parser.add_argument("--truth-grading", type=float, default=5.0, help="its largest over smallest element")
    parser.add_argument("--truth-element", default="middle", choices=("fbar", "one_point", "middle"))
    given = parser.parse_args()
    study = Study.of(given, slow=not given.without_slow)
    driver.hold(study, given.out)
    jobs = {given.out / f"{n:03d}.json": (study, given.out, n) for n in given.rows or range(given.draws)}
    missing = [job[-1] for path, job in jobs.items() if not path.exists()]
    started = time.perf_counter()
    make_truths(study, given.out, missing, given.workers)
    print(f"{SHOTS * len(missing)} shots: {time.perf_counter() - started:.0f} s", flush=True)
    each = driver.answers(answer, jobs, workers=given.workers, line=line)
    said = driver.about(study, given) | {"seconds": time.perf_counter() - started} | summary(each)
    print(table(said))
    driver.write(given.out / "summary.json", said, indent=1)


if __name__ == "__main__":
    main()
