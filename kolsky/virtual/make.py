"""The shots of a specification, made: truths simulated together, folders written by several processes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.virtual.records import Truth
from kolsky.virtual.shot_folder import is_there, write_shot
from kolsky.virtual.specification import Series, ShotSpecification
from kolsky.virtual.truth import TruthError, try_truths
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
    """Make shots one batch after the other, or over processes; on a GPU the truths of a batch come first,
    side by side, for its processes would take turns."""
    batches = _batches(todo, workers, device)
    if workers == 1:
        for batch in batches:
            yield from _made(batch, device, threads)
        return
    from concurrent.futures import as_completed

    from kolsky.base.process import process_pool

    share = threads or 1
    with process_pool(workers) as pool:
        if device == "cpu":
            for future in as_completed([pool.submit(_made, batch, device, share) for batch in batches]):
                yield from future.result()
            return
        for batch in batches:
            pairs = zip(batch, _truths(batch, device, threads), strict=True)
            jobs = [pool.submit(_written, place, truth, device, share) for place, truth in pairs]
            for job in as_completed(jobs):
                yield job.result()


def _batches(todo: Sequence[Place], workers: int, device: str) -> list[list[Place]]:
    """Shots whose truths are simulated together: those of one model, at most a share of a worker; on a GPU
    any shots."""
    groups: dict[Any, list[Place]] = {}
    for shot, folder in todo:
        try:
            key = Job.of(shot.quantities, shot.folder).group
        except ValueError as error:
            raise _refused(shot, error) from None
        groups.setdefault(key if device == "cpu" else None, []).append((shot, folder))
    size = max(1, -(-len(todo) // (4 * workers))) if workers > 1 else 8
    if device != "cpu":
        size = SIDE_BY_SIDE
    return [group[i : i + size] for group in groups.values() for i in range(0, len(group), size)]


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
