"""The shots of a specification, made: truths simulated together, folders written by several processes."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, as_completed, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from explicit.device import gpus
from kolsky.base.errors import InputError
from kolsky.virtual.records import Truth, TruthError
from kolsky.virtual.shot_folder import is_there, write_shot
from kolsky.virtual.specification import Series, ShotSpecification
from kolsky.virtual.truth import try_truths
from kolsky.virtual.truth_job import Job

SIDE_BY_SIDE = 128
"""Truths that a GPU simulates at the same time: each takes a multiprocessor, of which large GPUs have more,
and some MB."""


@dataclass(frozen=True)
class Made:
    """One shot that was made, or had been made before."""

    name: str
    """Its name."""
    folder: Path
    """Its folder."""
    fresh: bool
    """False if the folder held it already."""


@dataclass(frozen=True)
class NotMade:
    """One shot that could not be made."""

    shot: ShotSpecification
    """The shot."""
    reason: str
    """Why."""


Place = tuple[ShotSpecification, Path]
"""A shot and its folder."""


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
        If a specification cannot be made, or a folder holds something else. A shot whose simulation ends
        early or whose pictures cannot be is told of after the others are made.
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
    """Make shots of any specifications, each in a folder of its own.

    Parameters
    ----------
    places
        The shots and their folders.
    device, threads, workers, progress
        As in `make`.

    Raises
    ------
    InputError
        As `make`.
    """
    done, todo, refused = [], [], []
    for shot, folder in places:
        if is_there(shot, folder):
            done.append(Made(shot.name, folder, fresh=False))
            if progress is not None:
                progress(done[-1])
        else:
            todo.append((shot, folder))
    for made in _all_made(todo, device, threads, workers):
        if isinstance(made, NotMade):
            refused.append(made)
            continue
        done.append(made)
        if progress is not None:
            progress(made)
    if refused:
        first = min(refused, key=lambda one: one.shot.name)
        more = f"; {len(refused) - 1} more cannot be made" if len(refused) > 1 else ""
        raise _refused(first.shot, f"{first.reason}{more}")
    return sorted(done, key=lambda made: made.name)


def _all_made(
    todo: Sequence[Place], device: str, threads: int | None, workers: int
) -> Iterator[Made | NotMade]:
    """Make shots one batch after the other, or over processes."""
    jobs = [_job(shot) for shot, _ in todo]
    shared = gpus(device) if workers > 1 else gpus(device)[:1]
    batches = side_by_side(todo, jobs, len(shared)) if shared else _of_one_model(todo, jobs, workers)
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
        raise _refused(shot, error) from None


def _of_one_model(todo: Sequence[Place], jobs: Sequence[Job], workers: int) -> list[list[Place]]:
    """Shots whose truths a CPU simulates together: those of one model, at most a share of a worker."""
    groups: dict[Any, list[Place]] = {}
    for place, job in zip(todo, jobs, strict=True):
        groups.setdefault(job.group, []).append(place)
    size = max(1, -(-len(todo) // (4 * workers))) if workers > 1 else 8
    return [group[i : i + size] for group in groups.values() for i in range(0, len(group), size)]


def side_by_side(todo: Sequence[Place], jobs: Sequence[Job], count: int) -> list[list[Place]]:
    """Shots whose truths a GPU simulates at the same time, of any models.

    Equally many batches for every GPU, and the shots dealt out by the time that they simulate: a GPU is
    busy as long as the longest of its shots, however many stand beside it.

    Parameters
    ----------
    todo
        The shots and their folders.
    jobs
        Their simulations.
    count
        GPUs that share them.
    """
    rounds = -(-len(todo) // (count * SIDE_BY_SIDE))
    order = sorted(range(len(todo)), key=lambda k: -jobs[k].last)
    parts = [order[k :: rounds * count] for k in range(rounds * count)]
    return [[todo[k] for k in part] for part in parts if part]


def _over_gpus(
    pool: Executor, batches: Sequence[Sequence[Place]], shared: Sequence[str], device: str, threads: int
) -> Iterator[Made | NotMade]:
    """Simulate one batch a GPU at a time, and write the folders of each as soon as it is there."""
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


def _made(batch: Sequence[Place], device: str, threads: int | None) -> list[Made | NotMade]:
    """Simulate a batch and write its folders."""
    truths = _truths(batch, device, threads)
    return [_written(place, truth, device, threads) for place, truth in zip(batch, truths, strict=True)]


def _truths(batch: Sequence[Place], device: str, threads: int | None) -> list[Truth | TruthError]:
    try:
        return try_truths(
            [shot.quantities for shot, _ in batch], folder=batch[0][0].folder, device=device, threads=threads
        )
    except ValueError as error:
        raise _refused(batch[0][0], error) from None


def _written(place: Place, truth: Truth | TruthError, device: str, threads: int | None) -> Made | NotMade:
    """Write one folder, or say why there is none."""
    shot, folder = place
    if isinstance(truth, TruthError):
        return NotMade(shot, str(truth))
    try:
        write_shot(shot, truth, folder, device=device, threads=threads)
    except ValueError as error:
        return NotMade(shot, str(error))
    return Made(shot.name, folder, fresh=True)


def _refused(shot: ShotSpecification, error: Exception | str) -> InputError:
    return InputError(
        shot.folder,
        f"{shot.name} cannot be made: {error}",
        cure="change the specification: a gentler test or a coarser mesh",
    )
