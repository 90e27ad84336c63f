"""The options of `kolsky plan`."""

from typing import Annotated

import typer

from kolsky.cli.shared import (
    AsJson,
    Device,
    Mesh,
    Numbers,
    Out,
    Precision,
    ShotPath,
    Threads,
    listed,
    refusing_bad_input,
)


def plan(
    shot: ShotPath,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="NAME",
            help="Parameter to be estimated together with the others; repeat for more.",
            show_default="stiffness_factor, poisson, damping",
        ),
    ] = None,
    parameter: Numbers = None,
    outline_sigma: Annotated[
        str, typer.Option(help='Noise of an outline point, e.g. "4 um".', show_default="the shot's")
    ] = "",
    force_sigma: Annotated[
        str, typer.Option(help='Noise of the mean force of a bin, e.g. "0.1 N".', show_default="the shot's")
    ] = "",
    frame_rate: Annotated[
        str, typer.Option(help='Pictures per time, e.g. "120 kHz".', show_default="the shot's")
    ] = "",
    points: Annotated[
        str,
        typer.Option(
            help='Independent outline points per height, e.g. "3.6 1/mm".', show_default="the shot's"
        ),
    ] = "",
    clearance: Annotated[
        str,
        typer.Option(
            help='Heights near a platen that cannot be seen, e.g. "0.3 mm".', show_default="the shot's"
        ),
    ] = "",
    window: Annotated[
        str, typer.Option(metavar="START:END", help='E.g. "0 ms:1.2 ms".', show_default="the shot's")
    ] = "",
    rates: Annotated[
        str, typer.Option(metavar="FACTORS", help="Speeds of the flyer over the shot's to compare.")
    ] = "0.5,1,2",
    heights: Annotated[
        str, typer.Option(metavar="NUMBERS", help="How many best heights to choose.")
    ] = "1,2,3",
    discrepancy: Annotated[
        str, typer.Option(help="What the model leaves out: its change to a finer mesh (mesh), or none.")
    ] = "mesh",
    reach: Annotated[
        float, typer.Option(min=0.001, max=0.5, help="Range of the slopes over the parameters' scales.")
    ] = 0.1,
    mesh: Mesh = "24x32",
    precision: Precision = "fp64",
    device: Device = "cpu",
    threads: Threads = None,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Of the figures, e.g. pdf,svg; empty: no figures.")
    ] = "png",
    as_json: AsJson = False,
) -> None:
    """Foretell what a test like this shot would tell: where, when and how fast to measure.

    Writes plan.h5, plan.json, CSV tables and figures into SHOT/results.
    """
    with refusing_bad_input():
        from kolsky.cli.work import options
        from kolsky.cli.work.parts import Arithmetic
        from kolsky.cli.work.plan import Wishes
        from kolsky.cli.work.plan import plan as run

        run(
            shot,
            free=free or [],
            held=options.values("--parameter", parameter or []),
            wishes=Wishes(
                outline_sigma, force_sigma, frame_rate, points, clearance, window, rates, heights, discrepancy
            ),
            reach=reach,
            mesh=options.mesh("--mesh", mesh),
            arithmetic=Arithmetic(precision, device, threads),
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )
