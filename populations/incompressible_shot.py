"""m of an incompressible shot by the ratio held: `python -m populations.incompressible_shot --out FOLDER`.

The shot has m = 1.12 and nu = 0.49998, a bulk modulus of some 0.6 GPa. Its data are the middle of both
elements on a graded mesh that no identification has. It is identified as a user would, and with nu held at
four values.
The folder keeps shot and answers: called again, the study goes on where it stopped.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kolsky.identification import identify
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot
from populations import driver
from populations.pooled_shots import TRUE, M, maker

POISSON, SPEED, SEED = 0.49998, 3.6, 3
"""Of the shot; its flyer's speed [m/s]; seed of its noise."""
HELD = (None, 0.499, 0.4999, 0.49998, 0.49999)
"""Poisson's ratios that it is identified with; None: nothing is asked for."""


@dataclass(frozen=True)
class Study:
    """What is asked; two studies that are equal here have the same shot and the same answers."""

    mesh: tuple[int, int]
    refined_mesh: tuple[int, int]
    truth_mesh: tuple[int, int]
    device: str


def make_shot(study: Study, folder: Path) -> Path:
    """The shot's folder, made unless it is there."""
    place = folder / "shot"
    if not (place / "truth.json").exists():  # the last that is written
        script = maker()
        numerics = Numerics(mesh=study.truth_mesh, grading=script.NUMERICS.grading, device=study.device)
        script.make(place, SPEED, TRUE, seed=SEED, numerics=numerics, poisson=POISSON)
    return place


def answer(study: Study, folder: Path, poisson: float | None, threads: int | None) -> dict[str, Any]:
    """Identify the shot with a ratio held, or as a user would who asks for nothing."""
    held = {} if poisson is None else {"poisson": poisson}
    found = identify(load_shot(folder / "shot"), driver.settings(study, threads, held=held))
    return {
        "held": poisson,
        "poisson": found.fixed.get("poisson"),
        "least": found.surrogate.get("least_poisson"),
        "values": {name: e.value for name, e in found.estimates.items()},
        "sigmas": {name: e.sigma for name, e in found.estimates.items()},
        "verdicts": {name: e.outcome.value for name, e in found.estimates.items()},
        "excess": {fit.channel: fit.excess for fit in found.fit},
        "warnings": list(found.warnings),
    }


def table(each: list[dict[str, Any]]) -> str:
    """A row a ratio: m with its k = 2 interval, and what is said."""
    lines = ["| asked for | ν | m ± U (k = 2) | holds 1.12 | verdict | force, outline over expected |"]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    for one in each:
        value, U = one["values"][M], 2.0 * one["sigmas"][M]
        nu = one["poisson"] if one["poisson"] is not None else one["values"]["poisson"]
        asked = "nothing" if one["held"] is None else f"{one['held']:g}"
        excess = ", ".join(f"{size:.2g}" for size in one["excess"].values())
        holds = "yes" if abs(value - TRUE) <= U else "no"
        lines.append(
            f"| {asked} | {nu:.6g} | {value:.4f} ± {U:.4f} | {holds} | {one['verdicts'][M]} | {excess} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Do what the folder does not hold, and print the table."""
    parser = driver.command(__doc__)
    driver.add_meshes(parser, truth=(96, 129))
    given = parser.parse_args()
    study = Study(given.mesh, given.refined_mesh, given.truth_mesh, given.device)
    driver.hold(study, given.out)
    make_shot(study, given.out)
    threads = 1 if given.workers > 1 and given.device == "cpu" else None
    jobs = {
        given.out / f"{'free' if nu is None else nu}.json": (study, given.out, nu, threads) for nu in HELD
    }
    each = driver.answers(answer, jobs, workers=given.workers)
    print(table(each))
    driver.write(given.out / "summary.json", {"study": asdict(study), "each": each}, indent=1)


if __name__ == "__main__":
    main()
