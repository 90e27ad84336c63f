"""Answers of shots with known truth, stored and compared: `python -m populations.answers --out FOLDER`.

The shots are open-01 to open-04 and random shots of the virtual laboratory. Another program made the open
shots. `--made 10 --seed N` gives the random shots, the population of the study of wrong inputs. Each shot is
identified with the default free parameters. In addition open-01, open-03 and open-04 are identified with
Poisson's ratio and damping fixed at the shot file's values. Open-01 is also identified with its flyer's
record delayed by 20 us. Each answer is a file; existing files are not recomputed. `--against OTHER` compares
two folders in standard uncertainties. It shows the effect of a change of the program. `--show FILE.json ...`
prints the errors of stored answers over their standard uncertainties.
"""

import argparse
import json
import shutil
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from kolsky.identification import identify
from kolsky.inverse.result import Identification
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from populations import driver

ROOT = Path(__file__).resolve().parents[1]
RUNS = ROOT / "runs"
LATE = 20e-6
"""Delay of the flyer's record in the late shot [s]."""
HELD = ("poisson", "damping")
"""Parameters fixed at the shot file's values."""


@dataclass(frozen=True)
class Case:
    """One identification."""

    name: str
    folder: str
    hold: tuple[str, ...] = ()
    late: float = 0.0


def open_cases(out: Path) -> Iterator[Case]:
    """Cases of the open shots; open-02 uses open-01's shot file."""
    second = out / "shots" / "open-02"
    if not (second / "shot.toml").exists():
        shutil.copytree(ROOT / "tests" / "data" / "open-02", second, dirs_exist_ok=True)
        shutil.copy(RUNS / "open-01" / "shot.toml", second)
    for name in ("open-01", "open-02", "open-03", "open-04"):
        folder = str(second if name == "open-02" else RUNS / name)
        yield Case(name, folder)
        if name != "open-02":
            yield Case(f"{name}, held", folder, hold=HELD)
    yield Case("open-01, flyer 20 us late", str(RUNS / "open-01"), late=LATE)


def late_flyer(shot: Shot, lag: float) -> Shot:
    """The shot with its flyer's record delayed by `lag` [s]."""
    motion = replace(shot.flyer, time=shot.flyer.time + lag)
    window = shot.window[0], min(shot.window[1], float(motion.time[-1]))
    return replace(shot, flyer=motion, window=window)


def told(case: Case, found: Identification, seconds: float) -> dict[str, Any]:
    """The stored fields of an answer."""
    known = json.loads((Path(case.folder) / "truth.json").read_text("utf-8"))
    truths = {"stiffness_factor": known.get("m"), "poisson": known.get("nu"), "damping": known.get("beta_s")}
    return {
        "name": case.name,
        "values": {name: e.value for name, e in found.estimates.items()},
        "sigmas": {name: e.sigma for name, e in found.estimates.items()},
        "truths": {n: v for n, v in truths.items() if v is not None and n in found.estimates},
        "verdicts": {name: str(e.outcome) for name, e in found.estimates.items()},
        "causes": [
            {"key": c.key, "value": c.value, "evidence": c.evidence, "named": c.named, "beside": c.beside}
            for c in found.causes[:4]
        ],
        "runs": len(found.design.points),
        "seconds": seconds,
    }


def answer(case: Case, study: driver.ShotStudy) -> dict[str, Any]:
    """Identify a case."""
    shot = load_shot(case.folder)
    started = time.perf_counter()
    found = identify(
        late_flyer(shot, case.late) if case.late else shot, driver.settings(study, hold=case.hold)
    )
    return told(case, found, round(time.perf_counter() - started, 1))


def file_of(case: Case, out: Path) -> Path:
    """File of the answer to a case."""
    return out / f"{''.join(c if c.isalnum() else '-' for c in case.name)}.json"


def read(out: Path) -> dict[str, dict[str, Any]]:
    """The answers of a folder, by name."""
    found = [json.loads(path.read_text("utf-8")) for path in sorted(out.glob("*.json"))]
    return {one["name"]: one for one in found if "values" in one}


def table(answers: dict[str, dict[str, Any]]) -> str:
    """The answers as a Markdown table."""
    rows, ranks = [], []
    for one in answers.values():
        for name, value in one["values"].items():
            sigma, truth = one["sigmas"][name], one["truths"].get(name)
            off = "" if truth is None else f"{(value - truth) / sigma:+.2f}"
            of = "" if truth is None else f"{truth:.6g}"
            interval = f"{value:.6g} ± {2.0 * sigma:.2g}"
            rows.append((one["name"], name, of, interval, off, one["verdicts"][name]))
        causes = [
            f"{'**' if c['named'] else ''}{c['key']} = {c['value']:.6g}{'**' if c['named'] else ''}"
            f"{' beside ' + c['beside'] if c['beside'] else ''} ({c['evidence']:.0f})"
            for c in one["causes"][:2]
        ]
        ranks.append((one["name"], "; ".join(causes)))
    heads = ("shot", "", "truth", "answer (k = 2)", "error / sigma", "verdict")
    causes_heads = ("shot", "causes in their order (evidence)")
    return f"{driver.markdown(heads, rows)}\n\n{driver.markdown(causes_heads, ranks)}"


def errors(answers: Sequence[dict[str, Any]], name: str) -> list[float]:
    """(Value - truth) / sigma of every answer that has the parameter [-]."""
    return [
        (one["values"][name] - one["truths"][name]) / one["sigmas"][name]
        for one in answers
        if name in one["values"] and name in one["truths"]
    ]


def scatter(answers: Sequence[dict[str, Any]]) -> str:
    """Mean, scatter and maximum of the errors, and the number within k = 2, with one row for each
    parameter."""
    names = dict.fromkeys(name for one in answers for name in one["values"])
    rows = []
    for name in names:
        z = errors(answers, name)
        if z:
            inside = sum(abs(one) <= 2.0 for one in z)
            moments = (f"{statistics.mean(z):+.2f}", f"{statistics.pstdev(z):.2f}", f"{max(map(abs, z)):.2f}")
            rows.append((name, len(z), *moments, inside))
    return driver.markdown(("parameter", "shots", "mean", "scatter", "largest", "inside k = 2"), rows)


def changes(now: dict[str, dict[str, Any]], before: dict[str, dict[str, Any]]) -> str:
    """Comparison of values, uncertainties and verdicts with those of another folder."""
    rows = []
    for key in now.keys() & before.keys():
        one, other = now[key], before[key]
        for name in one["values"].keys() & other["values"].keys():
            move = (one["values"][name] - other["values"][name]) / other["sigmas"][name]
            ratio = one["sigmas"][name] / other["sigmas"][name]
            same = one["verdicts"][name] == other["verdicts"][name]
            verdict = "the same" if same else f"{other['verdicts'][name]} -> {one['verdicts'][name]}"
            rows.append((key, name, f"{move:+.3f}", f"{ratio:.3f}", verdict))
    return driver.markdown(("shot", "", "change / sigma", "U over the earlier one", "verdict"), sorted(rows))


def main() -> None:
    """Run the missing identifications and print the tables."""
    parser = driver.command(__doc__, seed=90417, table=lambda content: scatter(content["answers"]))
    driver.add_meshes(parser)
    parser.add_argument("--only", default="", help="cases whose names hold this")
    parser.add_argument("--made", type=int, default=0, help="drawn shots beside the open ones")
    parser.add_argument("--shots", type=Path, help="where they are; default a folder in --out")
    parser.add_argument("--against", type=Path, help="another folder of answers")
    given = parser.parse_args()
    study = driver.ShotStudy.of(given)
    cases = list(open_cases(given.out))
    if given.made:
        from populations.wrong_inputs import POPULATION, made

        place = given.shots or given.out / "made"
        asked = {"population": POPULATION, "right": given.made, "shots": 0, "least": 0, "out": place}
        folders = made(argparse.Namespace(**{**vars(given), **asked, "threads": study.threads}))
        cases += [Case(folder.name, str(folder)) for folder in folders]
    jobs = {file_of(case, given.out): (case, study) for case in cases if given.only in case.name}
    driver.answers(answer, jobs, workers=given.workers)
    found = read(given.out)
    print(table(found))
    right = [one for one in found.values() if "late" not in one["name"] and "held" not in one["name"]]
    print(f"\n{scatter(right)}")
    kept: dict[str, Any] = {"study": asdict(study), "answers": list(found.values())}
    if given.against is not None:
        before = read(given.against)
        print(f"\n{changes(found, before)}")
        kept["before"] = list(before.values())
    driver.write(given.out / "answers.json", kept, indent=1)


if __name__ == "__main__":
    main()
