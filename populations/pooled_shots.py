"""Five shots with the known value m = 1.12, pooled: `python -m populations.pooled_shots --out FOLDER`.

The shots are those of `runs/rate_shots.py`: one material and flyers of 0.7 to 4.5 m/s. They are the mean of
both elements on a mesh 1.5 times as fine as the answers' mesh, graded toward the faces' edges. The study
tests whether the 95 % interval of their mean contains 1.12. Existing results are not recomputed.
"""

import importlib.util
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from kolsky.identification import identify
from kolsky.inverse.settings import Numerics
from kolsky.results.hdf5 import write_identification
from kolsky.shot.load import load_shot
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.rate import collected_shot
from populations import driver

SCRIPT = Path(__file__).resolve().parents[1] / "runs" / "rate_shots.py"
SPEEDS = (0.7, 0.8, 1.4, 2.6, 4.5)
"""Speeds of the flyers [m/s], as in the script."""
TRUE = 1.12
"""True stiffness factor of all shots."""
M = "stiffness_factor"


@dataclass(frozen=True, kw_only=True)
class Study(driver.ShotStudy):
    """Settings of all shots."""

    truth_mesh: tuple[int, int]


def maker() -> ModuleType:
    """The script that makes the shots, as a module."""
    spec = importlib.util.spec_from_file_location("rate_shots", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def done(number: int, study: Study, folder: Path) -> str:
    """Make and identify a shot that is not in the folder. Returns a text about the steps."""
    shot = folder / f"rate-{number:02d}"
    result = shot / "results" / "identification.h5"
    if not (shot / "truth.json").exists():  # the file that is written last
        script = maker()
        numerics = Numerics(
            mesh=study.truth_mesh, grading=script.NUMERICS.grading, device=study.device, threads=study.threads
        )
        script.make(shot, SPEEDS[number - 1], TRUE, seed=number, numerics=numerics)
    if result.exists():
        return f"{shot.name} is there"
    found = identify(load_shot(shot), driver.settings(study))
    result.parent.mkdir(exist_ok=True)
    write_identification(result, found)
    m = found.estimates[M]
    return f"{shot.name}: m = {m.value:.4f} ± {2.0 * m.sigma:.4f} (k = 2), {m.outcome}"


def pooled(folder: Path) -> dict[str, Any]:
    """The shots' values and their mean, from the results in the folder; ValueError for fewer than two
    identified shots."""
    names = [f"rate-{number:02d}" for number in range(1, len(SPEEDS) + 1)]
    (group,) = compare([collected_shot(folder / name, group="gel") for name in names]).groups
    if group.pooled is None:
        raise ValueError(f"{folder}: {len(group.counted)} of {len(names)} shots count, a mean needs two")
    low, high = group.pooled.interval
    counted = {shot.name for shot in group.counted}
    return {
        "shots": [
            {
                "shot": shot.name,
                "speed": speed,
                "value": shot.found.estimates[M].value,
                "U": 2.0 * shot.found.estimates[M].sigma,
                "counts": shot.name in counted,
            }
            for shot, speed in zip(group.shots, SPEEDS, strict=True)
        ],
        "true": TRUE,
        "mean": group.pooled.mean,
        "sigma": group.pooled.sigma,
        "95 % interval": [low, high],
        "holds the truth": bool(low <= TRUE <= high),
        "scatter between shots": group.pooled.scatter,
    }


def table(said: dict[str, Any]) -> str:
    """The shots as a Markdown table, followed by the mean."""
    rows = [
        (f"{s['speed']:g}", f"{s['value']:.4f}", f"{s['U']:.4f}", "yes" if s["counts"] else "no")
        for s in said["shots"]
    ]
    low, high = said["95 % interval"]
    held = "holds" if said["holds the truth"] else "does not hold"
    shots = driver.markdown(("flyer (m/s)", "$m$", "U (k = 2)", "counts"), rows)
    return f"{shots}\n\nmean {said['mean']:.4f}, 95 % {low:.4f} to {high:.4f}: {held} {said['true']:g}"


def main() -> None:
    """Run the missing shots and print the table."""
    parser = driver.command(__doc__)
    driver.add_meshes(parser)
    parser.add_argument("--truth-mesh", type=driver.mesh, default=(96, 129), metavar="96x129")
    given = parser.parse_args()
    study = Study.of(given)
    if study.truth_mesh[0] < 1.5 * study.refined_mesh[0]:
        parser.error("--truth-mesh: at least 1.5 times as fine as --refined-mesh")
    jobs = [(number, study, given.out) for number in range(1, len(SPEEDS) + 1)]
    for words in driver.results(done, jobs, given.workers):
        print(words, flush=True)
    said = pooled(given.out)
    print(table(said))
    driver.write(given.out / "pooled.json", {**said, "study": asdict(study)}, indent=1)


if __name__ == "__main__":
    main()
