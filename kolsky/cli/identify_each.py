"""`kolsky identify SHOT... --each`: every shot by itself, side by side in processes or on a cluster."""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, as_completed
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.errors import InputError, refuse
from kolsky.cli import texts
from kolsky.cli.identify_alone import Alone, Said, answered
from kolsky.cli.quiet import quietly

Answer = Said | InputError
"""What became of a shot: its answer, or why there is none."""


def refuse_shared(processes: int | None, dask: str) -> None:
    """Refuse workers where there is but one identification.

    Raises
    ------
    InputError
        If workers are asked for.
    """
    for option, given in (("--processes", processes is not None), ("--dask", bool(dask))):
        if given:
            raise InputError(
                texts.COMMAND_LINE,
                f"{option} shares out shots that are identified by themselves",
                cure="give --each, or leave it out: shots that are identified together run side by side",
            )


def identify_each(
    shots: Sequence[Path], alike: Alone, *, processes: int | None, dask: str, as_json: bool
) -> None:
    """Identify every shot by itself, write the results of each, print in the order of the shots.

    Parameters
    ----------
    shots
        Folders, or shot.toml.
    alike
        What is asked of every shot; its folder of results, if given, holds one of each shot's name.
    processes, dask
        Who shares them: processes of this machine, or the workers of a scheduler, which see the same folders.
    as_json
        Print one JSON object.

    Raises
    ------
    InputError
        If two shots would write to one place, or there are no such workers; after the others' answers, if
        some shots cannot be used.
    """
    started = perf_counter()
    from kolsky.cli.sweep_options import Workers
    from kolsky.cli.terminal import print_result, progress_bars, since

    tasks = [
        replace(alike, shot=shot, out=out) for shot, out in zip(shots, _places(shots, alike.out), strict=True)
    ]
    workers = Workers(processes, dask)
    if dask or processes is not None:
        # Workers of a scheduler share their machines: one thread each, unless more are asked for.
        threads = workers.threads(alike.solver.threads or (1 if dask else None))
        tasks = [replace(task, solver=replace(task.solver, threads=threads)) for task in tasks]
    found: list[Answer] = []
    with workers.executor() as executor:
        if executor is None:
            found = [_tried(task, processes=2) for task in tasks]
        else:
            with progress_bars() as progress:
                found = shared(executor, tasks, lambda done: progress("shots", done, len(tasks)))
    names = [_name(shot) for shot in shots]
    there = [one for one in found if isinstance(one, Said)]
    print_result(
        {"shots answered": f"{len(there)} of {len(shots)}"},
        {"shots": [_object(shot, one) for shot, one in zip(shots, found, strict=True)]} if as_json else None,
        answers=[f"{one.shot}: {line}" for one in there for line in one.answers],
        rest={"reports": ", ".join(str(one.page) for one in there), "wall time": since(started)},
        warnings=[
            f"{name}: {line}"
            for name, one in zip(names, found, strict=True)
            if isinstance(one, Said)
            for line in one.warnings
        ],
    )
    refuse([problem for one in found if isinstance(one, InputError) for problem in one.problems])


def shared(executor: Callable[[], Any], tasks: Sequence[Alone], told: Callable[[int], None]) -> list[Answer]:
    """Have an executor's workers answer.

    Parameters
    ----------
    executor
        Makes the executor, as in `doe.executors.run_chunks`.
    tasks
        The shots; results are in their order, whoever ends first.
    told
        Called with the number of shots that are done.

    Raises
    ------
    InputError
        If a worker was lost.
    """
    found: dict[int, Answer] = {}
    told(0)
    try:
        with executor() as pool:
            flying = {pool.submit(_in_worker, task): i for i, task in enumerate(tasks)}
            for future in as_completed(flying):
                found[flying[future]] = future.result()
                told(len(found))
    except _losses() as error:
        raise InputError(
            texts.COMMAND_LINE,
            f"a worker was lost with {len(found)} of {len(tasks)} shots answered ({error})",
            cure="take fewer workers or more memory; the shots that were answered have their results",
        ) from error
    return [found[i] for i in range(len(tasks))]


def _losses() -> tuple[type[BaseException], ...]:
    """What is raised where a worker died, of this machine or, once it is in use, of Dask."""
    if "distributed" not in sys.modules:
        return BrokenExecutor, CancelledError
    return BrokenExecutor, CancelledError, import_module("distributed").scheduler.KilledWorker


def _in_worker(task: Alone) -> Answer:
    """The answer of a worker, whose terminal belongs to others."""
    with quietly(True):
        return _tried(task, processes=1)


def _tried(task: Alone, *, processes: int) -> Answer:
    """The answer, or what is wrong with the shot."""
    try:
        return answered(task, processes=processes)
    except InputError as error:
        return error


def _name(shot: Path) -> str:
    """Name of a shot's folder."""
    from kolsky.shot.schema.reading import folder_of

    return folder_of(shot).resolve().name


def _places(shots: Sequence[Path], out: Path | None) -> list[Path | None]:
    """Where each shot's results go; None for its own folder `results`.

    Raises
    ------
    InputError
        If a shot stands twice, or two have one name in `out`.
    """
    from kolsky.shot.schema.reading import folder_of

    places = [folder_of(shot).resolve() if out is None else out / _name(shot) for shot in shots]
    double = sorted({str(place) for place in places if places.count(place) > 1})
    if double:
        raise InputError(
            texts.COMMAND_LINE,
            f"two shots would write to {double[0]}",
            cure="name each shot once; with --out their folders need names of their own",
        )
    return [None] * len(shots) if out is None else list(places)


def _object(shot: Path, one: Answer) -> dict[str, Any]:
    """A shot in the object of `--json`."""
    if isinstance(one, Said):
        return {"folder": str(shot), "report": str(one.page), "answer": one.said, "problem": None}
    return {"folder": str(shot), "report": None, "answer": None, "problem": str(one)}
