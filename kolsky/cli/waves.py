"""`kolsky waves`: from the bar signals of a shot to curves, files and a page."""

from time import perf_counter
from typing import TYPE_CHECKING

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, Out, ShotPath

if TYPE_CHECKING:
    from kolsky.bars.result import ReducedTest


def waves(shot: ShotPath, out: Out = None, figures: Figures = "", as_json: AsJson = False) -> None:
    """Reduce a shot's bar signals: forces, equilibrium, strain, rate and stress, each with its uncertainty.

    A test between bars needs the tables bars, recorders and gauges in shot.toml; without gauges it is a
    flyer test. Writes waves.h5, waves.html and CSV tables into SHOT/results.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.bars.reduction.output import summary
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import print_result, progress_bars, since
    from kolsky.report.result_folder import write_waves_results
    from kolsky.shot.schema.reading import folder_of
    from kolsky.shot.waves import waves as reduced

    place = out or folder_of(shot) / "results"
    with progress_bars() as progress:
        result = reduced(shot, results=usable_folder(place), progress=progress)
    folder = usable_folder(place)
    write_waves_results(folder, result, formats=formats)
    print_result(
        _rows(result),
        summary(result) if as_json else None,
        rest={
            "result": folder / "waves.h5",
            "page": folder / "waves.html",
            "wall time": since(started),
        },
        warnings=result.remarks,
    )


def _rows(result: "ReducedTest") -> dict[str, str]:
    """The lines that a terminal gets."""
    from kolsky.report.pages.waves import answers, means_over, quantity

    balanced = result.reduction.balanced
    return {
        "shot": result.name,
        **{
            row["name"]: f"{row['value']} ± {row['U']} {row['unit']}".rstrip() + " (k = 2)"
            for row in answers(result)
        },
        "balanced": "never"
        if balanced is None
        else "{:.4g} to {:.4g} µs".format(*(1e6 * t for t in balanced)),
        **({"means": said} if (said := means_over(result)) else {}),
        **_own(result),
        **{name: quantity(value, unit) for name, (value, unit) in result.facts.items()},
    }


def _own(result: "ReducedTest") -> dict[str, str]:
    """Rows of one kind of test."""
    from kolsky.bars.result import FlyerResult, WavesResult

    if isinstance(result, WavesResult):
        return {
            "analysis": result.analysis,
            "windows": f"by {result.windows.source}",
            "validity": result.validity,
        }
    assert isinstance(result, FlyerResult)  # there is no third kind
    rows = {
        name: "not found: " + how if at is None else f"{1e3 * at:.4f} ms"
        for name, at, _, how in result.events
        if name != "end of symmetry"
    }
    return {**rows, "validity": result.validity, "clocks": result.synchronisation or "no incident transducer"}
