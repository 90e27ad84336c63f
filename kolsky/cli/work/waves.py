"""`kolsky waves`: from the bar signals of a shot to curves, files and a page."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from kolsky.bars.reduction.output import summary, write_csv, write_hdf5
from kolsky.bars.result import FlyerResult, ReducedTest, WavesResult
from kolsky.base.files import filling, usable_folder
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import tell
from kolsky.report.formats import FIGURES
from kolsky.shot.schema.reading import folder_of
from kolsky.shot.waves import waves as reduced


def waves(shot: Path, *, out: Path | None, formats: Sequence[str], as_json: bool) -> None:
    """Reduce, write and print.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    formats
        Also save the figure alone, in these formats.
    as_json
        Print one JSON object instead of a table.

    Raises
    ------
    InputError
        If the shot or its files cannot be used, or results cannot be written.
    """
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    place = out or folder_of(shot) / "results"
    with bars() as progress:
        result = reduced(shot, results=usable_folder(place), progress=progress)
    folder = usable_folder(place)
    from kolsky.report.canvas import save_figures
    from kolsky.report.pages.waves import answers, figures_of, quantity, write_page

    with filling(folder) as partial:
        write_hdf5(partial / "waves.h5", result)
        write_csv(partial, result)
        write_page(partial / "waves.html", result)
        if formats:
            save_figures(partial / "figures", result, formats=tuple(formats), registry=figures_of(result))
    rows = {
        "shot": result.name,
        **{
            row["name"]: f"{row['value']} ± {row['U']} {row['unit']}".rstrip() + " (k = 2)"
            for row in answers(result)
        },
        "balanced": "never"
        if result.reduction.balanced is None
        else "{:.4g} to {:.4g} µs".format(*(1e6 * t for t in result.reduction.balanced)),
        **_own(result),
        **{name: quantity(value, unit) for name, (value, unit) in result.facts.items()},
    }
    tell(
        [],
        rows,
        summary(result) if as_json else None,
        rest={
            "result": folder / "waves.h5",
            "page": folder / "waves.html",
            "wall time": f"{perf_counter() - started:.1f} s",
        },
        warnings=result.remarks,
    )


def _own(result: ReducedTest) -> dict[str, str]:
    """Rows of one kind of test."""
    if isinstance(result, WavesResult):
        return {"windows": f"by {result.windows.source}"}
    assert isinstance(result, FlyerResult)  # there is no third kind
    rows = {
        name: "not found: " + how if at is None else f"{1e3 * at:.4f} ms"
        for name, at, _, how in result.events
        if name != "end of symmetry"
    }
    return {**rows, "validity": result.validity, "clocks": result.synchronisation or "no incident transducer"}
