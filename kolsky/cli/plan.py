"""`kolsky plan`: where and when to measure, and the uncertainty of the parameters to expect."""

from dataclasses import replace
from time import perf_counter
from typing import Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import (
    AsJson,
    Device,
    Mesh,
    Numbers,
    Out,
    Precision,
    ShotPath,
    SolverOptions,
    Threads,
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
        str, typer.Option(metavar="FACTORS", help="Flyer speeds to compare, relative to the shot's.")
    ] = "0.5,1,2",
    heights: Annotated[
        str, typer.Option(metavar="NUMBERS", help="How many best heights to choose.")
    ] = "1,2,3",
    discrepancy: Annotated[
        str, typer.Option(help="Model error: the change to a finer mesh (mesh), or none.")
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
    """Predict the uncertainty of a planned test like this shot: where, when and how fast to measure.

    Writes plan.h5, plan.json, CSV tables and figures into SHOT/results.
    """
    started = perf_counter()
    held = texts.values("--parameter", parameter or [])
    elements = texts.mesh("--mesh", mesh)
    formats = texts.figure_formats(figures)
    texts.one_of("--discrepancy", discrepancy, ("mesh", "none"))
    changes: dict[str, Any] = {
        name: texts.physical(option, text, unit)
        for name, option, text, unit in (
            ("outline_sigma", "--outline-sigma", outline_sigma, "m"),
            ("force_sigma", "--force-sigma", force_sigma, "N"),
            ("points", "--points", points, "1/m"),
            ("clearance", "--clearance", clearance, "m"),
        )
        if text
    }
    if frame_rate:
        changes["frame_interval"] = _frame_interval(frame_rate)
    if window:
        changes["window"] = _window(window)
    names = tuple(texts.ranges("--free", [_without_bounds(name) for name in free])) if free else None
    speeds = texts.numbers("--rates", rates)
    counts = texts.numbers("--heights", heights)
    if any(count != round(count) or count < 1.0 for count in counts):
        raise InputError(
            texts.COMMAND_LINE,
            "must be whole numbers from 1",
            key="--heights",
            value=heights,
            cure="write them with commas, e.g. --heights 1,3,5",
        )
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, progress_bars, since

    loaded, folder = load(shot, out)
    numerics = SolverOptions(precision=precision, device=device, threads=threads).numerics(elements)
    from kolsky.report.result_folder import write_results
    from kolsky.studies.planning import output
    from kolsky.studies.planning import plan as planning
    from kolsky.studies.planning.information import instruments_of

    with usable(loaded), progress_bars() as progress:
        found = planning.plan(
            loaded,
            names=names or planning.NAMES,
            held=held,
            instruments=lambda prepared: replace(instruments_of(prepared), **changes),
            rates=speeds or planning.RATES,
            heights=[int(count) for count in counts] or (1, 2, 3),
            reach=reach,
            discrepancy=(0.0, 0.0) if discrepancy == "none" else None,
            numerics=numerics,
            progress=progress,
        )
    write_results(folder, found, formats=formats)
    print_result(
        output.rows(found),
        output.to_json(found) if as_json else None,
        rest={"folder": folder, "wall time": since(started)},
        warnings=[f"{part}: {e.unseen}" for part, e in found.expected.items() if e.unseen],
    )


def _frame_interval(text: str) -> float:
    """ "120 kHz" as time between pictures [s]."""
    rate = texts.physical("--frame-rate", text, "1/s")
    if not rate > 0.0:
        raise InputError(
            texts.COMMAND_LINE,
            "must be > 0",
            key="--frame-rate",
            value=text,
            cure='write a rate with its unit, e.g. "30 kHz"',
        )
    return 1.0 / rate


def _window(text: str) -> tuple[float, float]:
    """ "0 ms:1.2 ms" as start and end [s]."""
    ends = text.split(":")
    if len(ends) != 2:
        raise InputError(
            texts.COMMAND_LINE,
            f"--window {text!r} cannot be read",
            cure='write START:END, e.g. "0 ms:1.2 ms"',
        )
    start, end = (texts.physical("--window", part, "s") for part in ends)
    return start, end


def _without_bounds(text: str) -> str:
    """Name of a free parameter, which has no bounds in a plan."""
    if "=" in text:
        raise InputError(
            texts.COMMAND_LINE,
            f"--free {text!r}: a plan has no bounds",
            cure=f"write --free {text.partition('=')[0]}, and its value with -p",
        )
    return text
