"""The open shots with mesh-converged histories: `python -m populations.converged_shots --out FOLDER open-01`.

Another program made the open shots; they contain its mesh error. The correction is the difference between its
exact history and this solver's converged history (`populations.open_courses`). It is added to the exported
force and outline. Noise, clock errors and all other errors of the exports remain. The shots are identified
with default settings; existing results are not recomputed.
"""

import json
import shutil
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from kolsky.base.arrays import FloatArray
from populations.answers import RUNS, Case, answer, file_of, read, scatter, table
from populations.driver import ShotStudy, add_meshes, answers, command, write
from populations.open_courses import FINE, SHOTS, Course

FLAT = 1e-7
"""Successive points of a surface lie on a platen if their distance along the axis is smaller than this
[m]."""


def radius_at(y: FloatArray, r: FloatArray, height: float) -> float:
    """Radius of a surface at a height [m]; NaN where the surface has folded onto a platen."""
    first = last = len(y) // 2
    while first > 0 and y[first] - y[first - 1] > FLAT:
        first -= 1
    while last < len(y) - 1 and y[last + 1] - y[last] > FLAT:
        last += 1
    side = slice(first, last + 1)
    return float(CubicSpline(y[side], r[side], extrapolate=False)(height))


def converged(name: str, out: Path) -> Path:
    """Folder of the shot in `out`, with the correction added to force and outline."""
    folder = out / name
    if (folder / "converged.json").exists():
        return folder
    source = RUNS / name if (RUNS / name / "shot.toml").exists() else RUNS.parent / "tests" / "data" / name
    shutil.copytree(source, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("results", "*.py"))
    if not (folder / "shot.toml").exists():
        shutil.copy(RUNS / "open-01" / "shot.toml", folder)  # one file contains both
    course = Course(name)
    both = [course.runs(course.true[None], FINE, element=e, grading=5.0) for e in ("one_point", "fbar")]
    theirs = course.seen
    begin = theirs["t"][0]

    rows, header = _table(folder / "centreline.csv")
    lacks = []
    for row in rows:
        k = int(np.searchsorted(theirs["t"], row[1] - 1e-9))
        if row[1] < begin - 1e-9 or k == len(theirs["t"]):
            continue  # no difference at rest
        height = 1e-3 * row[2]
        ours = np.mean([radius_at(run.surface_y[0, k], run.surface_r[0, k], height) for run in both])
        change = ours - radius_at(theirs["y"][k], theirs["r"][k], height)
        if np.isfinite(change):
            row[3] += 1e3 * change
            lacks.append(change)
    _write_table(folder / "centreline.csv", header, rows)

    rows, header = _table(folder / "scope.csv")
    column = header.split(",").index("CH2 transmitted (V)")
    ours = np.mean([run.force_transmission[0] for run in both], axis=0)
    change = ours - theirs["transmitted"][course.within]
    times = begin + course.times[course.within]
    facts = json.loads((SHOTS / name / "facts.json").read_text("utf-8"))
    rows[:, column] += facts["scope"]["sensitivity_V_per_N"]["transmitted"] * np.interp(
        rows[:, 0], times, change, left=0.0, right=0.0
    )
    _write_table(folder / "scope.csv", header, rows)
    told = {"force, N rms": _rms(change), "outline, um rms": 1e6 * _rms(np.array(lacks))}
    (folder / "converged.json").write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    return folder


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _table(path: Path) -> tuple[FloatArray, str]:
    with path.open(encoding="utf-8") as lines:
        header = lines.readline().strip()
    return np.loadtxt(path, delimiter=",", skiprows=1), header


def _write_table(path: Path, header: str, rows: FloatArray) -> None:
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.10g")


def main() -> None:
    """Make and identify the missing shots, and print the table."""
    parser = command(__doc__)
    add_meshes(parser)
    parser.add_argument("shots", nargs="+", help="open-01 to open-04")
    given = parser.parse_args()
    study = ShotStudy.of(given)
    jobs = {}
    for name in given.shots:
        folder = converged(name, given.out / "shots")
        print(f"{name}: its course lacked {(folder / 'converged.json').read_text('utf-8')}", flush=True)
        case = Case(f"{name}, converged", str(folder))
        jobs[file_of(case, given.out)] = (case, study)
    answers(answer, jobs, workers=given.workers)
    found = read(given.out)
    print(table(found))
    print(f"\n{scatter(list(found.values()))}")
    meshes = {"mesh": study.mesh, "refined_mesh": study.refined_mesh}
    write(given.out / "answers.json", {"study": meshes, "answers": list(found.values())}, indent=1)


if __name__ == "__main__":
    main()
