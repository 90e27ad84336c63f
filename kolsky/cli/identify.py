"""`kolsky identify`: load, identify, write, print."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.cli import texts
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

if TYPE_CHECKING:
    from kolsky.inverse.settings import Settings
    from kolsky.shot.records import Shot


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
    tables and the ledger joint.sqlite in the folder joint; the same command goes on where it ended.
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
    if len(shots) > 1 or joint.asked:
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
    from kolsky.cli.inputs import load, usable
    from kolsky.cli.terminal import print_result, progress_bars, since

    loaded, folder = load(shots[0], out)
    if relaxation:
        from kolsky.inverse.relaxing import with_relaxation

        loaded = with_relaxation(loaded, *texts.relaxation("--relaxation", relaxation))
    numerics = solver.numerics(coarse)
    from kolsky import identification
    from kolsky.inverse.settings import Settings
    from kolsky.report import printed
    from kolsky.report.fit_table import fit_line
    from kolsky.report.result_folder import PAGE, load_identify_page, write_identify_results
    from kolsky.results.summary import to_json

    settings = Settings(
        free=ranges,
        held=held,
        hold=kept,
        numerics=numerics,
        refined_mesh=refined,
        replicates=replicates,
        methods="all" if methods == "all" else "surrogate",
        bayes=bayes,
        pull="conditioned" if pull == "conditioned" else "first",
        seed=seed,
    )
    with usable(loaded), progress_bars() as progress:
        found = identification.identify(loaded, settings, progress=progress, meanwhile=[load_identify_page])
        if diagnose:
            found = identification.diagnose(found, loaded, settings, progress=progress)
    write_identify_results(folder, found, loaded, formats=formats, processes=2)
    beside, said, doubts = _paper_method(loaded, settings, folder) if method == "paper" else ({}, {}, [])
    print_result(
        {**printed.details(found), **beside},
        {**to_json(found), **said} if as_json else None,
        answers=[*(printed.answer(e) for e in found.estimates.values()), fit_line(found)],
        rest={"report": folder / PAGE, "wall time": since(started)},
        warnings=[*found.warnings, *doubts],
    )


def _paper_method(
    shot: "Shot", settings: "Settings", folder: Path
) -> tuple[dict[str, str], dict[str, Any], list[str]]:
    """The paper's answer: rows to print, keys of the JSON object, warnings. Its files are written.

    Without one there is none of these but a warning: our own answer stands.
    """
    from doe.ledger import LedgerError
    from kolsky.cli.terminal import progress_bars
    from kolsky.shot.curve import with_pull
    from kolsky.studies import paper_output
    from kolsky.studies.paper_method import BOUNDS, paper_method

    given = {name: span for name, span in (settings.free or {}).items() if span and name in BOUNDS}
    try:
        with progress_bars() as progress:
            found = paper_method(
                with_pull(shot, settings.pull),
                bounds=given,
                held=settings.held,
                numerics=settings.numerics,
                refined_mesh=settings.refined_mesh,
                ledger=folder / f"{paper_output.STEM}.sqlite",
                progress=progress,
            )
    except (ValueError, LedgerError, OSError) as error:
        return {}, {paper_output.STEM: None}, [f"the paper's method has no answer: {error}"]
    paper_output.write_paper_method(folder, found)
    return (
        paper_output.rows(found),
        {paper_output.STEM: paper_output.to_json(found)},
        paper_output.warnings(found),
    )
