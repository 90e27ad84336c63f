"""`kolsky repeats`: several tests of one kind to their mean curve with its band."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Figures, OutFolder

FEWEST = 2
"""Tests that have a scatter between them."""


def repeats(
    shots: Annotated[
        list[Path], typer.Argument(metavar="SHOT...", help="Two or more shots with bars and gauges.")
    ],
    out: OutFolder = Path("repeats"),
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Average the stress-strain curves of repeated tests between bars, with a confidence band.

    Writes repeats.csv: the mean, its 95 % band (scatter and shared uncertainties), every test.
    """
    formats = texts.figure_formats(figures)
    if len(shots) < FEWEST:
        raise InputError(
            texts.COMMAND_LINE,
            f"got {len(shots)} shot, the scatter between tests needs {FEWEST} or more",
            cure="name all repeats of the test",
        )
    from kolsky.base.files import filling, usable_folder, write_table
    from kolsky.cli.terminal import print_result, progress_bars
    from kolsky.shot.repeated_tests import repeats as repeated

    folder = usable_folder(out)
    try:
        with progress_bars() as progress:
            found = repeated(shots, progress=progress)
    except ValueError as error:
        raise InputError(
            texts.COMMAND_LINE, str(error), cure="give two tests or more of one specimen and setup"
        ) from error
    with filling(folder) as partial:
        write_table(partial / "repeats.csv", found.columns())
        if formats:
            from kolsky.report.canvas import save_figures

            save_figures(partial / "figures", found.mean, formats=formats)
    said = found.summary()
    (first, last), largest = said["strain_range"], said["largest_mean_stress"]
    low, high = largest["band"]
    print_result(
        {
            "tests": ", ".join(found.names),
            "strains": f"{first:.4g} to {last:.4g}",
            "largest mean stress": f"{largest['value']:.4g} Pa, 95 % band {low:.4g} to {high:.4g} Pa"
            f" at strain {largest['strain']:.4g}",
            "scatter between tests there": f"{largest['scatter']:.3g} Pa",
        },
        said if as_json else None,
        rest={"curves": folder / "repeats.csv"},
        warnings=found.mean.repeats.remarks,
    )
