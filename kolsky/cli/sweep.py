"""The options of `kolsky sweep`."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import (
    AsJson,
    Corrected,
    Device,
    Element,
    Hourglass,
    Mesh,
    Numbers,
    Out,
    PastData,
    Precision,
    ShotPath,
    Threads,
    listed,
    refusing_bad_input,
)


def sweep(
    shot: ShotPath,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="NAME=LOW:HIGH[:LEVELS]",
            help="A parameter to vary; repeat for more. LEVELS belong to a factorial.",
            show_default="friction=0:2 and stiffness_factor=0.75:1.25, 10 levels each",
        ),
    ] = None,
    parameter: Numbers = None,
    design: Annotated[
        str,
        typer.Option(
            help="factorial, fractional, composite, box-behnken or csv; with --runs points lhs, maximin, "
            "sobol, halton or d-optimal."
        ),
    ] = "factorial",
    runs: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Points of a design that takes any number.")
    ] = 64,
    generators: Annotated[
        str, typer.Option(metavar="WORDS", help='Of a fractional design, a word a parameter, e.g. "a b ab".')
    ] = "",
    points: Annotated[
        Path | None, typer.Option(metavar="CSV", help="File of a csv design; columns NAME (UNIT).")
    ] = None,
    mesh: Mesh = "16x22",
    element: Element = "one_point",
    hourglass: Hourglass = "stiffness",
    nearly_incompressible: Corrected = False,
    precision: Precision = "fp64",
    device: Device = "cpu",
    threads: Threads = None,
    past_data: PastData = "continue",
    seed: Annotated[int, typer.Option(min=0, help="Seed of a random design.")] = 1,
    log: Annotated[
        list[str] | None,
        typer.Option("--log", metavar="NAME", help="Spread this parameter evenly in its logarithm; repeat."),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(
            "--where",
            metavar="INEQUALITY",
            help='Leave out points that break it, e.g. "friction <= 2 * stiffness_factor" (SI); repeat.',
        ),
    ] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Share the runs out over so many processes of this machine.")
    ] = None,
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Give the runs to a Dask scheduler: address or its file.")
    ] = "",
    ledger: Annotated[
        str,
        typer.Option(
            help="File that keeps every run as it is made, so that nothing is run twice, or none.",
            show_default="sweep.sqlite among the results",
        ),
    ] = "",
    retry: Annotated[bool, typer.Option("--retry", help="Run again what did not complete before.")] = False,
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Run the I-th of N parts of the design.", show_default="all")
    ] = "1/1",
    merge: Annotated[
        list[Path] | None,
        typer.Option("--merge", metavar="LEDGER", help="Take over another ledger's runs; repeat for more."),
    ] = None,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Run a design of experiments over a shot's parameters; writes sweep.csv, a row a run, and sweep.html."""
    from kolsky.cli.work import options
    from kolsky.cli.work.designchoice import DesignChoice
    from kolsky.cli.work.parts import Arithmetic
    from kolsky.cli.work.sweep import sweep as run
    from kolsky.cli.work.sweeprecords import Records
    from kolsky.cli.work.workers import Workers

    with refusing_bad_input():
        if options.one_of("--design", design, options.DESIGNS) == "factorial":
            factors = vary or ["friction=0:2:10", "stiffness_factor=0.75:1.25:10"]
            bounds, counts = options.levels("--vary", factors)
        elif design == "csv":
            options.none("--vary", vary or [], "--design csv, whose file names the parameters")
            bounds, counts = {}, []
        else:
            bounds = options.spans("--vary", vary or ["friction=0:2", "stiffness_factor=0.75:1.25"])
            counts = []
        run(
            shot,
            choice=DesignChoice(
                kind=design,
                bounds=bounds,
                levels=counts,
                runs=runs,
                seed=seed,
                generators=generators,
                points=points,
                logarithmic=tuple(log or ()),
                where=tuple(where or ()),
            ),
            held=options.values("--parameter", parameter or []),
            mesh=options.mesh("--mesh", mesh),
            arithmetic=Arithmetic(
                precision, device, threads, past_data, element, hourglass, nearly_incompressible
            ),
            records=Records(
                ledger, retry=retry, shard=options.shard("--shard", shard), merge=tuple(merge or ())
            ),
            workers=Workers(processes, dask),
            out=out,
            formats=listed(figures),
            as_json=as_json,
        )
