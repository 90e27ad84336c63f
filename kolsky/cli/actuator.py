"""`kolsky actuator simulate`, `invert` and `control`: a pressurised soft actuator.

The bend for a pressure, the pressures for wanted bends, and the closed loop with a simulated plant. Each
command ends with a page, a JSON file and figures.
"""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Device, Figures

if TYPE_CHECKING:
    from kolsky.report.body_views import ActuatorView


_ActuatorPath = Annotated[
    Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: geometry, material, gravity, pressures.")
]
_OutOfActuator = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SPEC's name/COMMAND"),
]


def actuator_simulate(
    spec: _ActuatorPath,
    out: _OutOfActuator = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the largest pressure for ParaView.")] = False,
    film: Annotated[
        str, typer.Option(metavar="FORMAT", help="Also write a film of every direction: mp4 or gif.")
    ] = "",
    device: Device = "cpu",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Simulate a pressurised actuator: bend over pressure in every direction of gravity, pristine and healed.

    Compares measured markers where SPEC names them. Writes actuator.html, actuator.json, bend.csv, line.csv.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    if film:
        texts.one_of("--film", film, ("mp4", "gif"))
    from kolsky.base.files import usable_folder
    from kolsky.bodies.actuator_bending import move, simulate_all, warnings_of
    from kolsky.bodies.actuator_markers import compared_markers
    from kolsky.bodies.actuator_output import (
        bends_json,
        markers_json,
        write_bends,
        write_markers,
        write_motion,
    )
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView
    from kolsky.report.films import write_actuator_film
    from kolsky.report.specimen_folder import write_solution_vtu

    read = read_actuator(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "simulate")
    try:
        directions = simulate_all(read)
        motions = move(read, directions)
        compared, stiffness, more = compared_markers(read, directions)
    except ValueError as error:
        raise read.toml.error("pressures", f"cannot be simulated: {error}") from None
    inputs = {**read.inputs, **more}
    warnings = warnings_of(directions)
    view = ActuatorView(
        read.name, directions, compared, stiffness=stiffness, motions=motions, warnings=warnings
    )
    said = bends_json(directions, inputs) | markers_json(compared, stiffness)

    def tables(partial: Path) -> None:
        write_bends(partial, directions)
        if motions:
            write_motion(partial / "motion.csv", motions)
        if compared:
            write_markers(partial / "markers.csv", compared)
        for one in directions:
            if vtu:
                write_solution_vtu(partial / f"{one.name}.vtu", one.pristine.solution)
            if film:
                write_actuator_film(partial / f"{one.name}.{film}", one)

    _write_result(
        folder, view, said, inputs, formats=formats, as_json=as_json, started=started, more=tables,
    )  # fmt: skip


def actuator_invert(
    spec: _ActuatorPath,
    out: _OutOfActuator = None,
    device: Device = "cpu",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Find the pressures for the bends of `invert`, by Newton's method on the exact slope of the bend.

    Separate chambers have a pressure each, found by bounded least squares with a wanted tip. Writes
    actuator.html and actuator.json.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.base.files import usable_folder
    from kolsky.bodies.actuator_bending import Inversion, SearchEnd, pressure_for, pressures_for
    from kolsky.bodies.actuator_output import inversions_json
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView

    read = read_actuator(spec, device=device)
    section = read.declared.invert
    if section is None:
        raise read.toml.error("invert", "is missing", cure='add [invert] with angles = ["20 deg"] and most')
    folder = usable_folder(out or read.toml.path.with_suffix("") / "invert")
    found: dict[str, list[Inversion]] = {}
    for name, g in read.gravities.items():
        found[name] = []
        for angle in section.angles:
            if len(read.actuator.cavities) == 1 and section.tip is None:
                one = pressure_for(read.actuator, g, angle, most=section.most)
            else:
                one = pressures_for(read.actuator, g, angle=angle, tip=section.tip, most=section.most)
            found[name].append(one)
    warnings = [
        f"{name}: the pressure for {57.29577951308232 * one.angle:.4g}° is not a solution: {one.ended.value}"
        for name, each in found.items()
        for one in each
        if one.ended is not SearchEnd.YES
    ]
    view = ActuatorView(read.name, inversions=found, warnings=warnings)
    said = inversions_json(found, read.inputs)
    _write_result(folder, view, said, read.inputs, formats=formats, as_json=as_json, started=started)


def actuator_control(
    spec: _ActuatorPath,
    out: _OutOfActuator = None,
    basis: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Keep the reduced models there, and take them from there where the inputs are the same.",
        ),
    ] = None,
    device: Device = "cpu",
    figures: Figures = "",
    as_json: AsJson = False,
) -> None:
    """Close the loop of `control`: a reduced model in it, a plant of another stiffness with noise and delay.

    Writes actuator.html, actuator.json and every tick with its wall time, a CSV file a direction of gravity.
    """
    started = perf_counter()
    formats = texts.figure_formats(figures)
    from kolsky.base.files import usable_folder
    from kolsky.bodies.actuator_control import loop_warnings, run_control
    from kolsky.bodies.actuator_output import loop_json, write_loop
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView

    read = read_actuator(spec, device=device)
    section = read.declared.control
    if section is None:
        raise read.toml.error("control", "is missing", cure='add [control] with angles = ["20 deg"] and most')
    folder = usable_folder(out or read.toml.path.with_suffix("") / "control")
    kept = None if basis is None else usable_folder(basis)
    try:
        closed, reductions = run_control(read.actuator, read.gravities, section, basis=kept)
    except ValueError as error:
        raise read.toml.error("control", f"cannot be run: {error}") from None
    warnings = loop_warnings(closed, reductions, section)
    view = ActuatorView(read.name, closed=closed, reductions=reductions, warnings=warnings)
    said = loop_json(closed, reductions, read.inputs)

    def ticks(partial: Path) -> None:
        for name, run in closed.items():
            write_loop(partial / f"{name}.csv", run)

    _write_result(
        folder, view, said, read.inputs, formats=formats, as_json=as_json, started=started, more=ticks
    )  # fmt: skip


def _write_result(
    folder: Path,
    view: "ActuatorView",
    said: dict[str, Any],
    inputs: dict[str, str],
    *,
    formats: tuple[str, ...],
    as_json: bool,
    started: float,
    more: Callable[[Path], None] | None = None,
) -> None:
    """Write actuator.html, actuator.json, figures and what `more` writes, and print the result."""
    from kolsky.base.files import filling, write_json
    from kolsky.cli.terminal import print_result, since
    from kolsky.report.figures_alone import save_figures_alone
    from kolsky.report.pages.actuator import printed, write_page

    with filling(folder) as partial:
        if more is not None:
            more(partial)
        write_json(partial / "actuator.json", said)
        write_page(partial / "actuator.html", view, inputs)
        save_figures_alone(partial, view, formats)
    print_result(
        printed(view),
        said if as_json else None,
        rest={"page": folder / "actuator.html", "wall time": since(started)},
        warnings=view.warnings,
    )
