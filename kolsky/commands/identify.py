"""`kolsky identify`: load, identify, write, print."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.commands import options
from kolsky.commands.parts import Arithmetic, load, since, tell, usable
from kolsky.outfolder import filling
from kolsky.progress import bars
from kolsky.report import printed
from kolsky.report.formats import FIGURES
from kolsky.shots import Shot


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
    from kolsky import identify as inverse
    from kolsky.results import to_json
    from kolsky.settings import Settings

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
    from kolsky.commands.report import RESULT_FILE, write_page
    from kolsky.recorded import recorded
    from kolsky.results import write_csv, write_identification

    recordings = recorded(shot, source, folder)
    with filling(folder) as partial:
        whole = replace(found, image_correlation=recordings.numbers)
        write_identification(partial / RESULT_FILE, whole)
        write_csv(partial, found)
        write_page(partial, found, recordings, formats)
