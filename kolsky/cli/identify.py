"""`kolsky identify`: load, identify, write, print."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.cli import texts
from kolsky.cli.identify_alone import Alone, answered
from kolsky.cli.identify_each import identify_each, refuse_shared
from kolsky.cli.identify_shots import (
    CurveNodes,
    GainEach,
    JointOptions,
    NoScatter,
    Roughness,
    SlowTests,
    identify_shots,
    refuse,
)
from kolsky.cli.options import SOLVER_DEFAULTS, AsJson, Figures, Mesh, Out, SolverOptions
from kolsky.inverse.parameters import PARAMETERS


def identify(
    shots: Annotated[
        list[Path],
        typer.Argument(metavar="SHOT...", help="A shot's folder, or its shot.toml; several: together."),
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="NAME[=LOW:HIGH]",
            help=f"Free parameter and the bounds of its design; repeat for more. {', '.join(PARAMETERS)}.",
            show_default="stiffness_factor, and poisson and damping where the data can tell them",
        ),
    ] = None,
    hold: Annotated[
        list[str] | None,
        typer.Option(
            "--hold",
            "-p",
            "--parameter",
            metavar="NAME[=VALUE]",
            help="Hold a parameter at the shot's value, or at this one (SI or with unit); repeat for more.",
        ),
    ] = None,
    mesh: Mesh = "24x32",
    refined_mesh: Annotated[
        str, typer.Option(metavar="NRxNY", help="The mesh the answer is given and checked on.")
    ] = "64x86",
    replicates: Annotated[
        int, typer.Option(min=0, help="Draws of the flyer's and the curve's noise; 0 leaves them out.")
    ] = 64,
    methods: Annotated[
        str,
        typer.Option(metavar="WHICH", help="surrogate, or all: least squares on the solver too (expensive)."),
    ] = "surrogate",
    method: Annotated[
        str,
        typer.Option(
            metavar="WHICH",
            help="least-squares, or paper: beside it that of Mates et al., a factorial over friction and m, "
            "a surface through Phi, a simplex; bounds by --free.",
        ),
    ] = "least-squares",
    solver: SolverOptions = SOLVER_DEFAULTS,
    bayes: Annotated[bool, typer.Option("--bayes", help="Sample the posterior too; needs emcee.")] = False,
    diagnose: Annotated[
        bool,
        typer.Option("--diagnose", help="Identify anew with each of the two likeliest causes put right."),
    ] = False,
    relaxation: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="What relaxes beside the curve, its constants free: prony, prony:2 or bergstrom_boyce.",
            show_default="as [relaxation] of shot.toml says",
        ),
    ] = "",
    each: Annotated[
        bool, typer.Option("--each", help="Several shots: each by itself, its results in its own folder.")
    ] = False,
    processes: Annotated[
        int | None, typer.Option(min=1, help="With --each: so many processes share the shots.")
    ] = None,
    dask: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS", help="With --each: a Dask scheduler shares them; address or its file."
        ),
    ] = "",
    slow_tests: SlowTests = None,
    curve_nodes: CurveNodes = 0,
    curve_roughness: Roughness = 0.1,
    gain_each: GainEach = "",
    no_scatter: NoScatter = False,
    pull: Annotated[str, typer.Option(help="The curve m refers to: first pull or conditioned.")] = "first",
    seed: Annotated[int, typer.Option(min=0, help="Seed of every random draw.")] = 1,
    out: Out = None,
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Identify the stiffness factor m (and more) of a shot, with its k = 2 interval and a report.

    Poisson's ratio and damping are free too where the force's ringing tells them; --hold poisson --hold
    damping keeps the shot's values, and the result says in any case what that would give.

    Writes identification.h5, report.html and CSV tables into SHOT/results.

    Several shots of one material are identified together, with slow tests if there are some: shared
    parameters, each shot's own clock and gain, the scatter between them. They leave joint.json, joint.html,
    tables and the ledger joint.sqlite in the folder joint; the same command goes on where it ended. With
    --each they are identified one by one, side by side in --processes or by the workers of --dask.
    """
    started = perf_counter()
    ranges = texts.ranges("--free", free) if free else None
    held, kept = texts.holds("--hold", hold or [])
    coarse, refined = texts.mesh("--mesh", mesh), texts.mesh("--refined-mesh", refined_mesh)
    texts.finer("--refined-mesh", refined, "--mesh", coarse)
    formats = texts.figure_formats(figures)
    texts.one_of("--methods", methods, ("surrogate", "all"))
    texts.one_of("--method", method, ("least-squares", "paper"))
    texts.one_of("--pull", pull, ("first", "conditioned"))
    texts.apart("--free", ranges or {}, "--hold", [*held, *kept])
    if bayes:
        texts.installed("--bayes", "emcee", "bayes")
    joint = JointOptions(slow_tests, curve_nodes, curve_roughness, gain_each, no_scatter)
    if (len(shots) > 1 or joint.asked) and not each:
        refuse_shared(processes, dask)
        refuse(
            {
                "methods": methods != "surrogate",
                "method": method != "least-squares",
                "bayes": bayes,
                "diagnose": diagnose,
            }
        )
        chosen = joint.settings(
            free=ranges,
            held=held,
            hold=kept,
            numerics=solver.numerics(coarse),
            refined=refined,
            replicates=replicates,
            seed=seed,
        )
        identify_shots(
            shots, joint, chosen, relaxation=relaxation, pull=pull, out=out, formats=formats, as_json=as_json
        )
        return
    alone = Alone(
        shots[0],
        solver,
        coarse,
        {
            "free": ranges,
            "held": held,
            "hold": kept,
            "refined_mesh": refined,
            "replicates": replicates,
            "methods": "all" if methods == "all" else "surrogate",
            "bayes": bayes,
            "pull": "conditioned" if pull == "conditioned" else "first",
            "seed": seed,
        },
        out=out,
        relaxation=relaxation,
        diagnose=diagnose,
        paper=method == "paper",
        formats=tuple(formats),
    )
    if each:
        joint.refuse()
        identify_each(shots, alone, processes=processes, dask=dask, as_json=as_json)
        return
    refuse_shared(processes, dask)
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.page_process import drawers

    found = answered(alone, processes=drawers())
    print_result(
        found.rows,
        found.said if as_json else None,
        answers=found.answers,
        rest={"report": found.page, "wall time": since(started)},
        warnings=found.warnings,
    )
