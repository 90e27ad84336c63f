"""The command line: parse, call, print. Imports beyond typer stay inside the commands: `--help` is fast."""

import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.material import material
from kolsky.cli.plan import plan
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
    refusing_bad_input,
)
from kolsky.cli.sweep import sweep

app = typer.Typer(
    name="kolsky",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="One impact test on a soft material, in; its dynamic stiffness with its uncertainty, out.",
)


def main() -> None:
    """Entry point of the `kolsky` command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal without a character (± in an old code page) gets its escape, not a traceback.
            stream.reconfigure(errors="backslashreplace")
    app()


def _listed(names: str) -> tuple[str, ...]:
    """The names of a comma-separated option."""
    return tuple(part.strip() for part in names.split(",") if part.strip())


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            typer.echo(f"kolsky {version('kolsky')}")
        except PackageNotFoundError:
            typer.echo("kolsky, not installed (running from its source folder)")
        raise typer.Exit


@app.callback()
def _kolsky(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


@app.command()
def new(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the shot's raw files are or will be.")
    ],
    bars: Annotated[
        bool, typer.Option("--bars", help="For a test between bars with strain gauges, without cameras.")
    ] = False,
) -> None:
    """Write an annotated shot.toml to fill in; an existing one is left as it is."""
    from kolsky.commands.new import write_template

    with refusing_bad_input():
        path = write_template(folder, bars=bars)
    then = "waves" if bars else "check"
    typer.echo(f"wrote {path}; put the raw files beside it, fill it in, then: kolsky {then} {folder}")


@app.command()
def check(shot: ShotPath, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood."""
    import json

    from kolsky.shots import check_shot
    from kolsky.shots.summary import as_json as summary_json

    with refusing_bad_input():
        loaded = check_shot(shot)
    if as_json:
        typer.echo(json.dumps(summary_json(loaded), indent=2, allow_nan=False))
    else:
        from kolsky.shots.summary import print_table

        print_table(loaded)


@app.command()
def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of an oscilloscope or recorder.")],
    form: Annotated[str | None, typer.Option("--format", help="Its format.", show_default="found")] = None,
    encoding: Annotated[str | None, typer.Option(help="Of text.", show_default="found")] = None,
    delimiter: Annotated[
        str | None, typer.Option(help="comma, semicolon, tab or blanks.", show_default="found")
    ] = None,
    decimal: Annotated[str | None, typer.Option(help='"." or ",".', show_default="found")] = None,
    header_line: Annotated[
        int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook.")] = None,
    time: Annotated[str | None, typer.Option(help="The time column, by name or number.")] = None,
    time_unit: Annotated[str | None, typer.Option(help="Its unit, e.g. ms.")] = None,
    interval: Annotated[
        str | None, typer.Option(help='Time from sample to sample, e.g. "100 ns".', show_default="found")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show what is in a recorder's file: channels, units, clock, and how the file was understood.

    The options are the keys of a `layout` in shot.toml, to try them out.
    """
    with refusing_bad_input():
        from kolsky.commands.channels import show

        show(
            file,
            as_json=as_json,
            format=form,
            encoding=encoding,
            delimiter=delimiter,
            decimal=decimal,
            header_line=header_line,
            sheet=sheet,
            time=time,
            time_unit=time_unit,
            interval=interval,
        )


@app.command()
def dic(
    shot: ShotPath,
    out: Out = None,
    device: Annotated[
        str, typer.Option(help='Where pictures are correlated: "cpu" or a CUDA device such as "cuda:0".')
    ] = "cpu",
    again: Annotated[bool, typer.Option("--again", help="Correlate even if the result is there.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the points of every frame as CSV.")] = False,
    vtp: Annotated[bool, typer.Option("--vtp", help="Also write the surfaces for ParaView.")] = False,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Correlate a shot's pictures: surfaces, outline and the flyer's travel, each with its sigma.

    Writes dic.h5, dic.html, centreline.csv, flyer.csv and the reporting table into SHOT/results. `kolsky
    identify` does the same by itself for a shot without exports.
    """
    with refusing_bad_input():
        from kolsky.commands.dic import correlate

        correlate(
            shot,
            out=out,
            device=device,
            again=again,
            csv=csv,
            vtp=vtp,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
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
        from kolsky.commands.waves import waves as run

        run(
            shot,
            out=out,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
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
        from kolsky.commands.wavespeed import wavespeed as run

        run(
            shot,
            out=out,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
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
        from kolsky.commands.repeats import repeats as run

        run(
            shots,
            out=out,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
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
    from kolsky.commands import options

    with refusing_bad_input():
        at = options.strains("--strains", strains)
        from kolsky.commands.rate import rate as run

        run(
            shots,
            group=group,
            strains=at,
            shared=shared,
            identify=identify,
            out=out,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
def calibrate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A calibration.toml, a shot.toml with a table calibration, or the folder of one.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="results")
    ] = None,
    export: Annotated[
        str,
        typer.Option(
            metavar="FORMATS", help="Also write the cameras as vic3d, dice, matchid, opencorr, dice-text."
        ),
    ] = "",
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Calibrate two cameras from pictures of a target, with the covariance of all parameters.

    Writes rig.yml, calibration.html and calibration.csv.
    """
    with refusing_bad_input():
        from kolsky.commands.calibrate import calibrate as run

        run(
            source,
            out=out,
            exports=_listed(export),
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
def identify(
    shot: ShotPath,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="NAME[=LOW:HIGH]",
            help="Free parameter and the bounds of its design; repeat for more. stiffness_factor, friction, "
            "poisson, damping, mass_damping, release_stress.",
            show_default="stiffness_factor",
        ),
    ] = None,
    parameter: Numbers = None,
    mesh: Mesh = "24x32",
    refined_mesh: Annotated[
        str, typer.Option(metavar="NRxNY", help="The mesh the answer is given and checked on.")
    ] = "64x86",
    replicates: Annotated[
        int, typer.Option(min=0, help="Draws of the flyer's and the curve's noise; 0 leaves them out.")
    ] = 16,
    methods: Annotated[
        str,
        typer.Option(metavar="WHICH", help="surrogate, or all: least squares on the solver too (dear)."),
    ] = "surrogate",
    element: Element = "one_point",
    hourglass: Hourglass = "stiffness",
    nearly_incompressible: Corrected = False,
    precision: Precision = "fp64",
    device: Device = "cpu",
    threads: Threads = None,
    past_data: PastData = "continue",
    bayes: Annotated[bool, typer.Option("--bayes", help="Sample the posterior too; needs emcee.")] = False,
    pull: Annotated[str, typer.Option(help="The curve m refers to: first pull or conditioned.")] = "first",
    seed: Annotated[int, typer.Option(min=0, help="Seed of every random draw.")] = 1,
    out: Out = None,
    figures: Annotated[
        str, typer.Option(metavar="FORMATS", help="Also save each figure alone, e.g. pdf,svg,png,csv.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Identify the stiffness factor m (and more) of a shot, with its k = 2 interval and a report.

    Writes identification.h5, report.html and CSV tables into SHOT/results.
    """
    from kolsky.commands import options
    from kolsky.commands.identify import identify as run
    from kolsky.commands.parts import Arithmetic

    with refusing_bad_input():
        run(
            shot,
            free=options.ranges("--free", free or ["stiffness_factor"]),
            held=options.values("--parameter", parameter or []),
            mesh=options.mesh("--mesh", mesh),
            refined_mesh=options.mesh("--refined-mesh", refined_mesh),
            replicates=replicates,
            methods=methods,
            arithmetic=Arithmetic(
                precision, device, threads, past_data, element, hourglass, nearly_incompressible
            ),
            bayes=bayes,
            pull=pull,
            seed=seed,
            out=out,
            formats=_listed(figures),
            as_json=as_json,
        )


@app.command()
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
        from kolsky.commands.report import report as run

        run(shot, out=out, formats=_listed(figures), as_json=as_json)


@app.command()
def simulate(
    shot: ShotPath,
    parameter: Numbers = None,
    mesh: Mesh = "24x32",
    element: Element = "one_point",
    hourglass: Hourglass = "stiffness",
    nearly_incompressible: Corrected = False,
    precision: Precision = "fp64",
    device: Device = "cpu",
    threads: Threads = None,
    past_data: PastData = "continue",
    out: Out = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the deforming mesh for ParaView.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a shot once, e.g. -p stiffness_factor=1.1, and compare it with the data.

    A run that fails is written up to its end; the exit code is then 1.
    """
    from kolsky.commands import options
    from kolsky.commands.identify import simulate as run
    from kolsky.commands.parts import Arithmetic

    with refusing_bad_input():
        completed = run(
            shot,
            parameters=options.values("--parameter", parameter or []),
            mesh=options.mesh("--mesh", mesh),
            arithmetic=Arithmetic(
                precision, device, threads, past_data, element, hourglass, nearly_incompressible
            ),
            out=out,
            vtu=vtu,
            as_json=as_json,
        )
    if not completed:
        raise typer.Exit(1)


app.command()(plan)
app.command()(sweep)
app.add_typer(material)


@app.command()
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
        from kolsky.commands.film import film as run

        run(
            shot,
            field=field,
            formats=_listed(formats),
            every=every,
            rate=rate,
            stills=stills,
            out=out,
            as_json=as_json,
        )
