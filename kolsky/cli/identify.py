"""The options of `kolsky identify` and `simulate`."""

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
    from kolsky.cli.work import options
    from kolsky.cli.work.identify import identify as run
    from kolsky.cli.work.parts import Arithmetic

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
            formats=listed(figures),
            as_json=as_json,
        )


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
    from kolsky.cli.work import options
    from kolsky.cli.work.parts import Arithmetic
    from kolsky.cli.work.simulate import simulate as run

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
