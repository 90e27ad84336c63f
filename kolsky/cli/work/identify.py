"""`kolsky identify`: load, identify, write, print."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.files import filling
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import Arithmetic, load, since, tell, usable
from kolsky.report import printed
from kolsky.report.formats import FIGURES
from kolsky.shot.records import Shot


def identify(
    shot: Path,
    *,
    free: Mapping[str, tuple[float, float] | None],
    held: Mapping[str, float],
    mesh: tuple[int, int],
    refined_mesh: tuple[int, int],
    replicates: int,
    methods: str,
    arithmetic: Arithmetic,
    bayes: bool = False,
    pull: str = "first",
    seed: int,
    out: Path | None,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """`kolsky identify`."""
    started = perf_counter()
    options.finer("--refined-mesh", refined_mesh, "--mesh", mesh)
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    options.one_of("--methods", methods, ("surrogate", "all"))
    options.one_of("--pull", pull, ("first", "conditioned"))
    options.apart("--free", free, "--parameter", held)
    if bayes:
        options.installed("--bayes", "emcee", "bayes")
    loaded, folder = load(shot, out)
    numerics = arithmetic.numerics(mesh)
    from kolsky import identification as inverse
    from kolsky.inverse.settings import Settings
    from kolsky.results.summary import to_json

    settings = Settings(
        free=free,
        held=held,
        numerics=numerics,
        refined_mesh=refined_mesh,
        replicates=replicates,
        methods="all" if methods == "all" else "surrogate",
        bayes=bayes,
        pull="conditioned" if pull == "conditioned" else "first",
        seed=seed,
    )
    with usable(loaded), bars() as progress:
        found = inverse.identify(loaded, settings, progress=progress)
    write_identified(folder, found, loaded, shot, formats)
    tell(
        [printed.answer(e) for e in found.estimates.values()],
        printed.details(found),
        to_json(found) if as_json else None,
        rest={"report": folder / "report.html", "wall time": since(started)},
        warnings=found.warnings,
    )


def write_identified(folder: Path, found: Any, shot: Shot, source: Path, formats: Sequence[str] = ()) -> None:
    """Write what `kolsky identify` leaves: result, tables, report and, if asked for, figures.

    Parameters
    ----------
    folder
        Where to.
    found
        The identification.
    shot, source
        The shot, and its folder or shot file.
    formats
        Formats of the figures.
    """
    from kolsky.cli.work.report import RESULT_FILE, write_page
    from kolsky.results.hdf5 import write_identification
    from kolsky.results.tables import write_csv
    from kolsky.shot.recorded import recorded

    recordings = recorded(shot, folder)
    with filling(folder) as partial:
        whole = replace(found, image_correlation=recordings.numbers)
        write_identification(partial / RESULT_FILE, whole)
        write_csv(partial, found)
        write_page(partial, found, recordings, formats)
