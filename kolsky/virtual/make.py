"""Folders of made shots: every file that a laboratory would have, and the truth beside them."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.errors import InputError
from kolsky.base.files import filling, write_table
from kolsky.virtual.instruments import measure_curve, measure_flyer, measure_outline, record_forces
from kolsky.virtual.records import Truth
from kolsky.virtual.scope_files import FORMATS
from kolsky.virtual.shot_file import shot_tables, toml_text
from kolsky.virtual.specification import Series, ShotSpecification
from kolsky.virtual.truth import TruthError, simulate_truths

TRUTH = "truth.json"
"""The answer of a made shot; nothing but this room and studies of the package itself read it."""
SURFACE = "truth_surface.npz"
TIME_DIGITS = "{:.10e}"


@dataclass(frozen=True)
class Made:
    """One shot that was made, or had been made before."""

    name: str
    """Its name."""
    folder: Path
    """Its folder."""
    fresh: bool
    """False if the folder held it already."""


def place_of(series: Series, shot: ShotSpecification, out: Path) -> Path:
    """Folder of a shot: `out` itself without a population, else one of the shot's name in it."""
    return out if series.declared.population is None else out / shot.name


def make(
    series: Series,
    out: Path,
    *,
    numbers: Sequence[int] | None = None,
    device: str = "cpu",
    threads: int | None = None,
    workers: int = 1,
    progress: Callable[[Made], None] | None = None,
) -> list[Made]:
    """Make the shots of a specification, those on one mesh together; what is there already is kept.

    Parameters
    ----------
    series
        The specification.
    out
        Folder of the shot, or of the population's folders.
    numbers
        Which shots; all if left out.
    device, threads
        Of the solver.
    workers
        Processes that share the shots.
    progress
        Called with each shot when it is complete.

    Raises
    ------
    InputError
        If a specification cannot be made, or a folder holds something else.
    """
    chosen = [series.shot(number) for number in (series.numbers if numbers is None else numbers)]
    done, todo = [], []
    for shot in chosen:
        folder = place_of(series, shot, out)
        if _is_there(shot, folder):
            done.append(Made(shot.name, folder, fresh=False))
            if progress is not None:
                progress(done[-1])
        else:
            todo.append((shot, folder))
    for made in _all_made(todo, device, threads, workers):
        done.append(made)
        if progress is not None:
            progress(made)
    return sorted(done, key=lambda made: made.name)


def _all_made(
    todo: Sequence[tuple[ShotSpecification, Path]], device: str, threads: int | None, workers: int
) -> Iterator[Made]:
    batches = _batches(todo, workers)
    if workers == 1:
        for batch in batches:
            yield from _made(batch, device, threads)
        return
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_made, batch, device, threads or 1) for batch in batches]):
            yield from future.result()


def _batches(
    todo: Sequence[tuple[ShotSpecification, Path]], workers: int
) -> list[list[tuple[ShotSpecification, Path]]]:
    """Shots that one model of the solver serves, in batches of at most a share of a worker."""
    from kolsky.virtual.truth import Job

    groups: dict[Any, list[tuple[ShotSpecification, Path]]] = {}
    for shot, folder in todo:
        try:
            key = Job.of(shot.quantities, shot.folder).group
        except ValueError as error:
            raise _refused(shot, error) from None
        groups.setdefault(key, []).append((shot, folder))
    size = max(1, -(-len(todo) // (4 * workers))) if workers > 1 else 8
    return [group[i : i + size] for group in groups.values() for i in range(0, len(group), size)]


def _made(batch: Sequence[tuple[ShotSpecification, Path]], device: str, threads: int | None) -> list[Made]:
    try:
        truths = simulate_truths(
            [shot.quantities for shot, _ in batch], folder=batch[0][0].folder, device=device, threads=threads
        )
    except (TruthError, ValueError) as error:
        raise _refused(batch[0][0], error) from None
    for (shot, folder), truth in zip(batch, truths, strict=True):
        try:
            write_shot(shot, truth, folder, device=device, threads=threads)
        except ValueError as error:
            raise _refused(shot, error) from None
    return [Made(shot.name, folder, fresh=True) for shot, folder in batch]


def _refused(shot: ShotSpecification, error: Exception) -> InputError:
    return InputError(shot.folder, f"{shot.name} cannot be made: {error}")


def write_shot(
    shot: ShotSpecification,
    truth: Truth,
    folder: Path,
    *,
    device: str = "cpu",
    threads: int | None = None,
) -> None:
    """Write the folder of one shot, whole or not at all; the truth last.

    Raises
    ------
    InputError
        If it cannot be written.
    ValueError
        If the specification's instruments cannot be.
    """
    q, number = shot.quantities, shot.number
    tables = shot_tables(q, truth.surface)
    form = FORMATS[q.scope.format]
    with filling(folder) as partial:
        form.write(partial / form.name, record_forces(q, truth, shot=number))
        frames = np.arange(len(truth.surface.time))
        given = truth.surface.time + q.imperfections.trigger - q.frames.clock_offset
        times = [TIME_DIGITS.format(t) for t in given]
        write_table(partial / "frames.csv", {"frame": frames, "time (s)": times})
        if q.exports.write:
            flyer = measure_flyer(q, truth, shot=number) * 1e3
            named = {"flyer displacement toward the specimen (mm)": [f"{d:.6f}" for d in flyer]}
            write_table(partial / "flyer.csv", {"frame": frames, "time (s)": times, **named})
            outline = measure_outline(q, truth, shot=number)
            columns: dict[str, Any] = {
                "frame": outline.frame,
                "time (s)": [times[k] for k in outline.frame],
                "y (mm)": [f"{y * 1e3:.6f}" for y in outline.y],
                "Z (mm)": [f"{Z * 1e3:.6f}" for Z in outline.Z],
            }
            write_table(partial / "centreline.csv", columns)
        strain, stress = measure_curve(q, shot=number)
        slow = {"nominal strain (-)": strain, "nominal stress (Pa)": stress}
        write_table(partial / "quasi_static.csv", slow)
        answer = _answer(shot)
        if q.cameras.write:
            from kolsky.virtual.pictures import write_pictures

            made = write_pictures(q, truth.surface, partial, shot=number, device=device, threads=threads)
            tables |= made.tables
            answer["cameras"] = made.answer
        (partial / "shot.toml").write_text(toml_text(tables, name=shot.name), encoding="utf-8")
        surface = truth.surface
        np.savez_compressed(
            partial / SURFACE,
            t=surface.time,
            y=surface.y.astype(np.float32),
            r=surface.r.astype(np.float32),
            d=surface.displacement,
            tilt=surface.tilt,
            t_force=truth.force_time,
            transmitted=truth.transmitted.astype(np.float32),
            incident=truth.incident.astype(np.float32),
        )
        (partial / TRUTH).write_text(json.dumps(answer, indent=1), encoding="utf-8")


def _answer(shot: ShotSpecification) -> dict[str, Any]:
    """What truth.json holds: the answer, and the specification that was made."""
    material = shot.quantities.material
    return {
        "m": material.stiffness_factor,
        "nu": material.poisson,
        "beta_s": material.damping,
        "friction": shot.quantities.imperfections.slip_friction or None,
        "specification": shot.content,
        "specification_sha256": _hash(shot),
        "number": shot.number,
    }


def _hash(shot: ShotSpecification) -> str:
    text = json.dumps(shot.quantities.model_dump(mode="json"), sort_keys=True) + f" {shot.number}"
    return hashlib.sha256(text.encode()).hexdigest()


def _is_there(shot: ShotSpecification, folder: Path) -> bool:
    """Whether the folder holds this very shot.

    Raises
    ------
    InputError
        If it holds something else.
    """
    if not folder.exists() or not any(folder.iterdir()):
        return False
    answer = folder / TRUTH
    try:
        same = json.loads(answer.read_text("utf-8")).get("specification_sha256") == _hash(shot)
    except (OSError, ValueError, AttributeError):
        same = False
    if not same:
        raise InputError(
            folder, "holds something else than this shot", cure="give another place with --out FOLDER"
        )
    return True
