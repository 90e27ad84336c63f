"""`kolsky identify` of one shot by itself: load, identify, write; what is then to be printed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kolsky.cli import texts
from kolsky.cli.options import SolverOptions

if TYPE_CHECKING:
    from kolsky.inverse.settings import Settings
    from kolsky.shot.records import Shot


@dataclass(frozen=True)
class Alone:
    """A shot that is identified by itself, as the command line asks for it; it can be pickled."""

    shot: Path
    """Its folder, or its shot.toml."""
    solver: SolverOptions
    """Numerical choices."""
    mesh: tuple[int, int]
    """Elements across the radius and along the length, of the search."""
    choices: Mapping[str, Any]
    """Fields of `kolsky.inverse.settings.Settings` beside the numerics."""
    out: Path | None = None
    """Where results go; None for the folder `results` of the shot."""
    relaxation: str = ""
    """What relaxes, as written; empty for what the shot declares."""
    diagnose: bool = False
    """Whether the likeliest causes are tried out."""
    paper: bool = False
    """Whether the method of Mates et al. is applied beside."""
    formats: tuple[str, ...] = ()
    """Formats of figures alone."""


@dataclass(frozen=True)
class Said:
    """What an identification has to say, its results being written; it can be pickled."""

    shot: str
    """Name of the shot."""
    answers: tuple[str, ...]
    """First lines: the free parameters with their intervals, the fit."""
    rows: Mapping[str, Any]
    """Names and values below them."""
    said: Mapping[str, Any]
    """The object of `--json`."""
    warnings: tuple[str, ...]
    """What to know before using the answer."""
    page: Path
    """The report."""


def answered(one: Alone, *, processes: int = 1) -> Said:
    """Identify a shot and write its results.

    Parameters
    ----------
    one
        The shot, and what is asked.
    processes
        Processes that draw the page; with 1 no others correlate pictures either.

    Raises
    ------
    InputError
        If the shot, an option or the folder of the results cannot be used.
    """
    from kolsky.cli.inputs import load, usable
    from kolsky.cli.terminal import progress_bars
    from kolsky.report.page_process import load_identify_page, page_process

    shot, folder = load(one.shot, one.out, forks=processes > 1)
    if one.relaxation:
        from kolsky.inverse.relaxing import with_relaxation

        shot = with_relaxation(shot, *texts.relaxation("--relaxation", one.relaxation))
    # Libraries that both processes need are loaded before one of them is forked, and no GPU is used yet.
    from kolsky.inverse.settings import Settings

    with page_process(processes) as page:
        numerics = one.solver.numerics(one.mesh)
        from kolsky import identification
        from kolsky.report import printed
        from kolsky.report.fit_table import fit_line
        from kolsky.report.result_folder import PAGE, write_identify_results
        from kolsky.results.summary import to_json

        settings = Settings(numerics=numerics, **one.choices)
        meanwhile, checked = ([load_identify_page], None) if page is None else ([], page.draw_ahead)
        with usable(shot), progress_bars() as progress:
            found = identification.identify(
                shot, settings, progress=progress, meanwhile=meanwhile, checked=checked
            )
            if one.diagnose:
                found = identification.diagnose(found, shot, settings, progress=progress)
        write_identify_results(folder, found, shot, formats=one.formats, processes=processes, page=page)
    beside, said, doubts = paper_answer(shot, settings, folder) if one.paper else ({}, {}, [])
    return Said(
        shot=shot.name,
        answers=(*(printed.answer(e) for e in found.estimates.values()), fit_line(found)),
        rows={**printed.details(found), **beside},
        said={**to_json(found), **said},
        warnings=(*found.warnings, *doubts),
        page=folder / PAGE,
    )


def paper_answer(
    shot: "Shot", settings: "Settings", folder: Path
) -> tuple[dict[str, str], dict[str, Any], list[str]]:
    """The paper's answer: rows to print, keys of the JSON object, warnings. Its files are written.

    Without one there is none of these but a warning: our own answer stands.
    """
    from doe.ledger import LedgerError
    from kolsky.cli.terminal import progress_bars
    from kolsky.shot.curve import with_pull
    from kolsky.studies import paper_output
    from kolsky.studies.paper_method import BOUNDS, paper_method

    given = {name: span for name, span in (settings.free or {}).items() if span and name in BOUNDS}
    try:
        with progress_bars() as progress:
            found = paper_method(
                with_pull(shot, settings.pull),
                bounds=given,
                held=settings.held,
                numerics=settings.numerics,
                refined_mesh=settings.refined_mesh,
                ledger=folder / f"{paper_output.STEM}.sqlite",
                progress=progress,
            )
    except (ValueError, LedgerError, OSError) as error:
        return {}, {paper_output.STEM: None}, [f"the paper's method has no answer: {error}"]
    paper_output.write_paper_method(folder, found)
    return (
        paper_output.rows(found),
        {paper_output.STEM: paper_output.to_json(found)},
        paper_output.warnings(found),
    )
