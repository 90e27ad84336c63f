"""The options of `kolsky waves`, `wavespeed` and `repeats`: tests between bars."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import AsJson, Out, ShotPath, listed, refusing_bad_input


def waves(
    shot: ShotPath,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save the figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Reduce a shot's bar signals: forces, equilibrium, strain, rate and stress, each with its uncertainty.

    A test between bars needs the tables bars, recorders and gauges in shot.toml; without gauges it is a
    flyer test. Writes waves.h5, waves.html and CSV tables into SHOT/results.
    """
    with refusing_bad_input():
        from kolsky.cli.work.waves import waves as run

        run(
            shot,
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )


def wavespeed(
    shot: ShotPath,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save the figure, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Find the bars' wave speed and the gauges' relative gain from a shot with the bars together.

    Needs the tables bars, recorders and gauges in shot.toml, no specimen. Writes wavespeed.csv into
    SHOT/results.
    """
    with refusing_bad_input():
        from kolsky.cli.work.wavespeed import wavespeed as run

        run(
            shot,
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )


def repeats(
    shots: Annotated[
        list[Path], typer.Argument(metavar="SHOT...", help="Two or more shots with bars and gauges.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path("repeats"),
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save the figure, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Average the stress-strain curves of repeated tests between bars, with a confidence band.

    Writes repeats.csv: the mean, its 95 % band (scatter and shared uncertainties), every test.
    """
    with refusing_bad_input():
        from kolsky.cli.work.repeats import repeats as run

        run(
            shots,
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )
