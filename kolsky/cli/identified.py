"""The options of `kolsky rate`, `report` and `film`: what is made of identified shots."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import AsJson, Out, ShotPath, listed, refusing_bad_input


def rate(
    shots: Annotated[list[Path], typer.Argument(metavar="SHOT...", help="Shots that were identified.")],
    group: Annotated[
        str,
        typer.Option(
            metavar="KEY", help="Compare shots with one value of this key of shot.toml, e.g. interface.faces."
        ),
    ] = "",
    strains: Annotated[str, typer.Option(metavar="NUMBERS", help="Nominal strains.")] = "0.1,0.3,0.5",
    shared: Annotated[
        float, typer.Option(min=0.0, help="Relative standard uncertainty that all m have in common.")
    ] = 0.0,
    identify: Annotated[bool, typer.Option("--identify", help="Identify shots without a result.")] = False,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where results go.")] = Path("rates"),
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure, e.g. pdf,svg,png.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Writes rates.h5, rates.html and CSV tables. A slope that the rates cannot carry is refused.
    """
    from kolsky.cli.work import options

    with refusing_bad_input():
        at = options.strains("--strains", strains)
        from kolsky.cli.work.rate import rate as run

        run(
            shots,
            group=group,
            strains=at,
            shared=shared,
            identify=identify,
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )


def report(
    shot: ShotPath,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Write report.html of an identified shot again, from its result and its files; nothing is simulated.

    Needs the results of `kolsky identify`, in SHOT/results or the folder of --out.
    """
    with refusing_bad_input():
        from kolsky.cli.work.report import report as run

        run(shot, out=out, formats=listed(figures), as_json=as_json)


def film(
    shot: ShotPath,
    field: Annotated[str, typer.Option(help="What colours it: stretch, pressure or energy.")] = "stretch",
    formats: Annotated[
        str,
        typer.Option(
            "--format", metavar="FORMATS", help="png (stills), mp4, gif, vtu (ParaView); several by commas."
        ),
    ] = "png",
    every: Annotated[int, typer.Option(min=1, help="Take every so many of the recorded times.")] = 1,
    rate: Annotated[float, typer.Option(min=1.0, max=120.0, help="Pictures a second of a film.")] = 25.0,
    stills: Annotated[int, typer.Option(min=1, max=1000, help="Number of stills.")] = 6,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Render the specimen of an identified shot between its platens, half of it cut away.

    Needs the results of `kolsky identify`; writes into their folder film.
    """
    with refusing_bad_input():
        from kolsky.cli.work.film import film as run

        run(
            shot,
            field=field,
            formats=listed(formats),
            every=every,
            rate=rate,
            stills=stills,
            out=out,
            as_json=as_json,
        )
