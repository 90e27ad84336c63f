"""`kolsky waves`, `wavespeed` and `repeats`: tests between bars, touching bars, and the mean of repeats."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from kolsky.base.files import usable_folder, write_folder
from kolsky.cli import texts
from kolsky.cli.options import Figures, Out, OutFolder, ShotPath
from kolsky.cli.terminal import print_result, progress_bars
from kolsky.report.figures_alone import figure_files

if TYPE_CHECKING:
    from kolsky.bars.records import ReducedTest


def waves(shot: ShotPath, out: Out = None, figures: Figures = ()) -> None:
    """Reduce a shot's bar signals: forces, equilibrium, strain, rate and stress, each with its uncertainty.

    A test between bars needs the tables bars, recorders and gauges in shot.toml; without gauges it is a
    flyer test. Writes waves.h5, waves.html and CSV tables into SHOT/results.
    """
    from kolsky.bars.reduction.output import summary
    from kolsky.report.result_folder import write_results
    from kolsky.schema.shot_file import folder_of
    from kolsky.shot.waves import waves as reduced

    place = out or folder_of(shot) / "results"
    with progress_bars() as progress:
        result = reduced(shot, results=usable_folder(place), progress=progress)
    folder = usable_folder(place)
    write_results(folder, result, formats=figures)
    print_result(
        _wave_rows(result),
        summary(result),
        files={"result": folder / "waves.h5", "page": folder / "waves.html"},
        warnings=result.remarks,
    )


def _wave_rows(result: "ReducedTest") -> dict[str, str]:
    """Lines of output for a terminal."""
    from kolsky.report.pages.waves import answers, means_over, quantity

    balanced = result.reduction.balanced
    return {
        "shot": result.name,
        **{
            row["Quantity"]: f"{row['Value']} ± {row['U']} {row['Unit']}".rstrip() + " (k = 2)"
            for row in answers(result)
        },
        "balanced": "never"
        if balanced is None
        else "{:.4g} to {:.4g} µs".format(*(1e6 * t for t in balanced)),
        **({"means": means} if (means := means_over(result)) else {}),
        **_rows_of_kind(result),
        **{name: quantity(value, unit) for name, (value, unit) in result.facts.items()},
    }


def _rows_of_kind(result: "ReducedTest") -> dict[str, str]:
    """Rows of one kind of test."""
    from kolsky.bars.records import FlyerResult, WavesResult

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


def wavespeed(shot: ShotPath, out: Out = None, figures: Figures = ()) -> None:
    """Find the bars' wave speed and the gauges' relative gain from a shot with the bars together.

    Needs the tables bars, recorders and gauges in shot.toml, no specimen. Writes wavespeed.csv into
    SHOT/results.
    """
    from kolsky.schema.shot_file import folder_of
    from kolsky.shot.waves import residual_columns, wave_speed_of, wave_speed_summary

    shot_name, speed, notes = wave_speed_of(shot)
    folder = usable_folder(out or folder_of(shot) / "results")
    write_folder(folder, figure_files(figures, speed), {"wavespeed": residual_columns(speed)})
    print_result(
        {
            "shot": shot_name,
            "wave speed c0": f"{speed.wave_speed:.2f} ± {2.0 * speed.wave_speed_sigma:.2f} m/s (k = 2)",
            "gain, transmission over incident": f"{speed.gain:.5f} ± {2.0 * speed.gain_sigma:.5f} (k = 2)",
            "residual, rms of peak": f"{100.0 * speed.rms:.2f} %",
            "residual, largest of peak": f"{100.0 * speed.largest:.2f} %",
            "plain shift, rms": f"{100.0 * speed.plain_rms:.2f} % at {speed.plain_wave_speed:.1f} m/s",
            "by Poisson's ratio": f"{speed.by_poisson:.3g} m/s per unit",
            "by distance": f"{speed.wave_speed / speed.distance * 1e-3:.3g} m/s per mm",
        },
        {"shot": shot_name, **wave_speed_summary(speed), "remarks": list(notes)},
        files={"residual": folder / "wavespeed.csv"},
        warnings=notes,
    )


_FEWEST = 2
"""Smallest number of tests with a scatter."""


def repeats(
    shots: Annotated[
        list[Path], typer.Argument(metavar="SHOT...", help="Two or more shots with bars and gauges.")
    ],
    out: OutFolder = Path("repeats"),
    figures: Figures = (),
) -> None:
    """Average the stress-strain curves of repeated tests between bars, with a confidence band.

    Writes repeats.csv: the mean, its 95 % band (scatter and shared uncertainties), every test.
    """
    if len(shots) < _FEWEST:
        raise texts.refusal(
            f"got {len(shots)} shot, the scatter between tests needs {_FEWEST} or more",
            cure="name all repeats of the test",
        )
    from kolsky.shot import waves

    folder = usable_folder(out)
    with progress_bars() as progress, texts.refused(cure="give two tests or more of one specimen and setup"):
        curves = waves.repeats(shots, progress=progress)
    write_folder(folder, figure_files(figures, curves.mean), {"repeats": curves.columns()})
    summary = curves.summary()
    (first, last), largest = summary["strain_range"], summary["largest_mean_stress"]
    low, high = largest["band"]
    print_result(
        {
            "tests": ", ".join(curves.names),
            "strains": f"{first:.4g} to {last:.4g}",
            "largest mean stress": f"{largest['value']:.4g} Pa, 95 % band {low:.4g} to {high:.4g} Pa"
            f" at strain {largest['strain']:.4g}",
            "scatter between tests there": f"{largest['scatter']:.3g} Pa",
        },
        summary,
        files={"curves": folder / "repeats.csv"},
        warnings=curves.mean.remarks,
    )
