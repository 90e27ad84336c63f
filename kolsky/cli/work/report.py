"""`kolsky report`: the page of an identified shot, made again from its result and its files."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.cli.work import options
from kolsky.cli.work.parts import load, since, tell, usable
from kolsky.report.formats import FIGURES

RESULT_FILE = "identification.h5"
PAGE = "report.html"


def report(shot: Path, *, out: Path | None, formats: Sequence[str], as_json: bool) -> None:
    """Write report.html and, if asked for, the figures; nothing is simulated.

    Parameters
    ----------
    shot
        The shot's folder.
    out
        Folder of the results, where the identification is too.
    formats
        Formats in which each figure is saved alone.
    as_json
        Whether to print JSON.

    Raises
    ------
    InputError
        If the shot or its result cannot be used, or the result belongs to other files than the shot's.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    from kolsky.results.hdf5 import read_identification
    from kolsky.shot.recorded import recorded

    loaded, folder = load(shot, out)
    path = folder / RESULT_FILE
    found = read_identification(path)
    _same_files(path, found.provenance.get("inputs", {}), loaded.inputs)
    _ahead(found)
    with usable(loaded):
        recordings = recorded(loaded, folder)
    with filling(folder) as partial:
        write_page(partial, found, recordings, formats, processes=2)
    rows = {"shot": loaded.name, "report": str(folder / PAGE)}
    if formats:
        rows["figures"] = str(folder / "figures")
    tell([], rows, rows if as_json else None, rest={"wall time": since(started)}, warnings=found.warnings)


def write_page(
    folder: Path, found: Any, recordings: Any, formats: Sequence[str] = (), *, processes: int = 1
) -> None:
    """Write the page of an identification into a folder, and its figures alone if formats are given.

    Parameters
    ----------
    folder
        An empty folder of `kolsky.base.files.filling`.
    found
        The identification.
    recordings
        What the shot's own files show, a `kolsky.shot.recorded.Recorded`.
    formats
        Any of `kolsky.report.formats.FIGURES`.
    processes
        How many draw, 1 or 2; see `kolsky.report.pages.parallel.drawn_by`.
    """
    _ahead(found)
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import RECORDINGS
    from kolsky.report.pages.identification import write_report

    write_report(folder / PAGE, found, recordings, processes=processes)
    if formats:
        save_figures(folder / "figures", recordings, formats=tuple(formats), registry=RECORDINGS)
        save_figures(folder / "figures", found, formats=tuple(formats))


def _ahead(found: Any) -> None:
    """Let the stills be rendered meanwhile; whoever asks first is the one that begins."""
    from kolsky.report.scene.stills import begin

    begin(found)


def _same_files(path: Path, then: Any, now: dict[str, str]) -> None:
    """Signals of one version of a file beside the result of another would mislead."""
    then = then if isinstance(then, dict) else {}
    differing = sorted(name for name in {*then, *now} if then.get(name) != now.get(name))
    if differing:
        more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
        raise InputError(
            path,
            f"was made from other files than those of the shot: {differing[0]}{more}",
            cure="run `kolsky identify` again, or put the files back",
        )
