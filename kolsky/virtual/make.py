"""Shots of a specification.

Truths are simulated together, and several processes write the folders.

A folder contains all files that a laboratory would have. The truth is in a subfolder.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, as_completed, wait
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from explicit.device import gpus
from kolsky.base.errors import InputError, refuse
from kolsky.base.files import filling, read_bytes, write_table
from kolsky.virtual.instruments import FORMATS, measure_curve, measure_flyer, measure_outline, record_forces
from kolsky.virtual.shot_file import shot_tables, toml_text
from kolsky.virtual.specification import Series, ShotSpecification
from kolsky.virtual.truth import Job, Truth, TruthError, try_truths

TRUTH = "truth.json"
"""File with the answer of a synthetic shot. Only the modules of synthetic tests and studies of the package
read it."""
SURFACE = "truth_surface.npz"
_ANSWER_LIMIT = 1_000_000
"""Largest size of `TRUTH` when read [bytes]."""
_TIME_DIGITS = "{:.10e}"


def write_shot(
    shot: ShotSpecification, truth: Truth, folder: Path, *, device: str = "cpu", threads: int | None = None
) -> None:
    """Write the folder of one shot, completely or not at all. The truth is written last."""
    q, number = shot.quantities, shot.number
    tables = shot_tables(q, truth.surface)
    form = FORMATS[q.scope.format]
    with filling(folder) as partial:
        form.write(partial / form.name, record_forces(q, truth, shot=number))
        frames = np.arange(len(truth.surface.time))
        given = truth.surface.time + q.imperfections.trigger - q.frames.clock_offset
        times = [_TIME_DIGITS.format(t) for t in given]
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
        answer = _answer_tables(shot)
        if q.cameras.write:
            from kolsky.virtual.pictures import write_pictures

            of_pictures, answer["cameras"] = write_pictures(
                q, truth.surface, partial, shot=number, device=device, threads=threads
            )
            tables |= of_pictures
        (partial / "shot.toml").write_text(toml_text(tables, name=shot.name), encoding="utf-8")
        surface = truth.surface
        np.savez_compressed(
            partial / SURFACE, t=surface.time, y=surface.y.astype(np.float32), r=surface.r.astype(np.float32),
            d=surface.displacement, tilt=surface.tilt, t_force=truth.force_time,
            transmitted=truth.transmitted.astype(np.float32), incident=truth.incident.astype(np.float32),
        )  # fmt: skip
        (partial / TRUTH).write_text(json.dumps(answer, indent=1), encoding="utf-8")


def _answer_tables(shot: ShotSpecification) -> dict[str, Any]:
    """Content of truth.json: the answer, and the specification."""
    material, relaxation = shot.quantities.material, shot.quantities.relaxation
    return {
        "m": material.stiffness_factor,
        "nu": material.poisson,
        "beta_s": material.damping,
        "friction": shot.quantities.imperfections.slip_friction or None,
        **({} if relaxation is None else {"relaxation": dict(relaxation.declared().values)}),
        "specification": shot.content,
        "specification_sha256": _hash(shot),
        "number": shot.number,
    }


def _hash(shot: ShotSpecification) -> str:
    content = shot.quantities.model_dump(mode="json")
    if content["relaxation"] is None:  # older folders have no such table in their hash
        del content["relaxation"]
    text = json.dumps(content, sort_keys=True) + f" {shot.number}"
    return hashlib.sha256(text.encode()).hexdigest()


def _holds_shot(shot: ShotSpecification, folder: Path) -> bool:
    """True if the folder contains this shot. Raises InputError if it contains something else."""
    if not folder.exists() or not any(folder.iterdir()):
        return False
    answer = folder / TRUTH
    try:
        found = json.loads(read_bytes(answer, limit=_ANSWER_LIMIT))
        same = found.get("specification_sha256") == _hash(shot)
    except (InputError, ValueError, AttributeError, RecursionError):
        same = False
    if not same:
        raise InputError(
            folder, "holds something else than this shot", cure="give another place with --out FOLDER"
        )
    return True


TRUTHS_PER_GPU = 128
"""Number of truths simulated in parallel on a GPU. Each uses one multiprocessor (large GPUs have more) and
some MB."""


@dataclass(frozen=True)
class Made:
    """One shot, made in this call or earlier."""

    name: str
    folder: Path
    fresh: bool
    """False if the folder already contained it."""


Place = tuple[ShotSpecification, Path]
"""A shot and its folder."""


def place_of(series: Series, shot: ShotSpecification, out: Path) -> Path:
    """Folder of a shot. It is `out` without a population, otherwise a folder in it with the shot's name."""
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
    """Make the shots of a specification, those on one mesh together.

    Existing shots are kept.

    ``out``: folder of the shot, or of the population's folders. ``numbers``: numbers of the shots; default:
    all. Raises InputError if a specification cannot be made, or if a folder contains something else. If a
    simulation ends early, or if pictures cannot be made, this is reported after the other shots are made.
    """
    chosen = [series.shot(number) for number in (series.numbers if numbers is None else numbers)]
    places = [(shot, place_of(series, shot, out)) for shot in chosen]
    return make_places(places, device=device, threads=threads, workers=workers, progress=progress)


def make_places(
    places: Sequence[Place],
    *,
    device: str = "cpu",
    threads: int | None = None,
    workers: int = 1,
    progress: Callable[[Made], None] | None = None,
) -> list[Made]:
    """Make shots of any specifications, each in a separate folder.

    ``device``, ``threads``, ``workers``, ``progress``: as in `make`. Raises InputError for the reasons of
    `make`.
    """
    done, problems = [], []
    held = [Made(shot.name, folder, fresh=False) for shot, folder in places if _holds_shot(shot, folder)]
    there = {made.folder for made in held}
    todo = [place for place in places if place[1] not in there]
    for made in chain(held, _all_made(todo, device, threads, workers)):
        if isinstance(made, InputError):
            problems.append(made)
            continue
        done.append(made)
        if progress is not None:
            progress(made)
    refuse(sorted(problems, key=str))
    return sorted(done, key=lambda made: made.name)


def _all_made(
    todo: Sequence[Place], device: str, threads: int | None, workers: int
) -> Iterator[Made | InputError]:
    """Make shots in successive batches, or in several processes."""
    jobs = [_job(shot) for shot, _ in todo]
    shared = gpus(device) if workers > 1 else gpus(device)[:1]
    batches = gpu_batches(todo, jobs, len(shared)) if shared else _of_one_model(todo, jobs, workers)
    if workers == 1:
        for batch in batches:
            yield from _made(batch, device, threads)
        return
    from kolsky.base.process import process_pool

    share = threads or 1
    with process_pool(workers) as pool:
        if shared:
            yield from _over_gpus(pool, batches, shared, device, share)
            return
        for future in as_completed([pool.submit(_made, batch, device, share) for batch in batches]):
            yield from future.result()


def _job(shot: ShotSpecification) -> Job:
    try:
        return Job.of(shot.quantities, shot.folder)
    except ValueError as error:
        raise _shot_error(shot, error) from None


def _of_one_model(todo: Sequence[Place], jobs: Sequence[Job], workers: int) -> list[list[Place]]:
    """Batches of shots of one model for a CPU, limited to a share of a worker."""
    groups: dict[Any, list[Place]] = {}
    for place, job in zip(todo, jobs, strict=True):
        groups.setdefault(job.group, []).append(place)
    size = max(1, -(-len(todo) // (4 * workers))) if workers > 1 else 8
    return [group[i : i + size] for group in groups.values() for i in range(0, len(group), size)]


def gpu_batches(todo: Sequence[Place], jobs: Sequence[Job], count: int) -> list[list[Place]]:
    """Batches of shots simulated in parallel on a GPU, of any models. Every GPU gets the same number of
    batches. Shots are distributed by their simulated time, because the longest shot of a batch determines its
    run time."""
    rounds = -(-len(todo) // (count * TRUTHS_PER_GPU))
    order = sorted(range(len(todo)), key=lambda k: -jobs[k].last)
    parts = [order[k :: rounds * count] for k in range(rounds * count)]
    return [[todo[k] for k in part] for part in parts if part]


def _over_gpus(
    pool: Executor, batches: Sequence[Sequence[Place]], shared: Sequence[str], device: str, threads: int
) -> Iterator[Made | InputError]:
    """Simulate one batch per GPU at a time. The folders of a batch are written as soon as it is finished."""
    waiting, idle = list(batches), list(shared)
    running: dict[Future[Any], tuple[str, Sequence[Place]]] = {}
    writing: set[Future[Any]] = set()
    while waiting or running or writing:
        while waiting and idle:
            gpu, batch = idle.pop(0), waiting.pop(0)
            running[pool.submit(_truths, batch, gpu, threads)] = gpu, batch
        done, _ = wait({*running, *writing}, return_when=FIRST_COMPLETED)
        for future in done & writing:
            writing.remove(future)
            yield future.result()
        for future in done & running.keys():
            gpu, batch = running.pop(future)
            idle.append(gpu)
            for place, truth in zip(batch, future.result(), strict=True):
                writing.add(pool.submit(_written, place, truth, device, threads))


def _made(batch: Sequence[Place], device: str, threads: int | None) -> list[Made | InputError]:
    """Simulate a batch and write its folders."""
    truths = _truths(batch, device, threads)
    return [_written(place, truth, device, threads) for place, truth in zip(batch, truths, strict=True)]


def _truths(batch: Sequence[Place], device: str, threads: int | None) -> list[Truth | TruthError]:
    try:
        return try_truths(
            [shot.quantities for shot, _ in batch], folder=batch[0][0].folder, device=device, threads=threads
        )
    except ValueError as error:
        raise _shot_error(batch[0][0], error) from None


def _written(place: Place, truth: Truth | TruthError, device: str, threads: int | None) -> Made | InputError:
    """Write one folder, or return the reason why it cannot be made."""
    shot, folder = place
    if isinstance(truth, TruthError):
        return _shot_error(shot, truth)
    try:
        write_shot(shot, truth, folder, device=device, threads=threads)
    except ValueError as error:
        return _shot_error(shot, error)
    return Made(shot.name, folder, fresh=True)


def _shot_error(shot: ShotSpecification, error: Exception) -> InputError:
    return InputError(
        shot.folder,
        f"{shot.name} cannot be made: {error}",
        cure="change the specification: a gentler test or a coarser mesh",
    )
