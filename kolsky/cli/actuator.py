"""`kolsky actuator simulate`, `invert` and `control`: a pressurised soft actuator."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.files import Files, usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.cli.options import Figures, Vtu
from kolsky.cli.terminal import print_result
from kolsky.inverse.settings import Device
from kolsky.report.figures_alone import figure_files

if TYPE_CHECKING:
    from kolsky.report.body_views import ActuatorView


_ActuatorPath = Annotated[
    Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: geometry, material, gravity, pressures.")
]
_OutOfActuator = Annotated[
    Path | None, Option("Where results go.", metavar="FOLDER", show_default="SPEC's name/COMMAND")
]


def actuator_simulate(
    spec: _ActuatorPath,
    out: _OutOfActuator = None,
    vtu: Vtu = False,
    device: Device = "cpu",
    figures: Figures = (),
) -> None:
    """Simulate a pressurised actuator: bend over pressure in every direction of gravity, pristine and healed.

    Compares measured markers where SPEC names them. Writes actuator.html, actuator.json, bend.csv, line.csv.
    """
    from kolsky.bodies.actuator_bending import simulate_all, warnings_of
    from kolsky.bodies.actuator_markers import compared_markers
    from kolsky.bodies.actuator_output import bend_tables, bends_json, markers_json
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView
    from kolsky.report.result_folder import write_solution_vtu

    read = read_actuator(spec, device=device)
    folder = usable_folder(out or read.toml.path.with_suffix("") / "simulate")
    with read.toml.refusing("pressures", "cannot be simulated"):
        directions = simulate_all(read)
        compared, stiffness, marker_files = compared_markers(read, directions)
    inputs = {**read.inputs, **marker_files}
    view = ActuatorView(
        read.name, directions, compared, stiffness=stiffness, warnings=warnings_of(directions)
    )
    content = bends_json(directions, inputs) | markers_json(compared, stiffness)

    solutions = {one.name: one.pristine.solution for one in directions if vtu}
    files = {f"{name}.vtu": partial(write_solution_vtu, solution=one) for name, one in solutions.items()}
    tables = bend_tables(directions, compared)
    _write_result(folder, view, content, inputs, figures, tables=tables, files=files)


def actuator_invert(
    spec: _ActuatorPath, out: _OutOfActuator = None, device: Device = "cpu", figures: Figures = ()
) -> None:
    """Find the pressures for the bends of `invert`, by least squares with the exact slope of the bend.

    Separate chambers have a pressure each, and may have a wanted tip. Writes actuator.html and
    actuator.json.
    """
    from kolsky.bodies.actuator_bending import Inversion, SearchEnd, pressures_for
    from kolsky.bodies.actuator_output import inversions_json
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView

    read = read_actuator(spec, device=device)
    section = read.declared.invert
    if section is None:
        raise read.toml.error("invert", "is missing", cure='add [invert] with angles = ["20 deg"] and most')
    folder = usable_folder(out or read.toml.path.with_suffix("") / "invert")
    inversions: dict[str, list[Inversion]] = {
        name: [
            pressures_for(read.actuator, g, angle=angle, tip=section.tip, most=section.most)
            for angle in section.angles
        ]
        for name, g in read.gravities.items()
    }
    warnings = [
        f"{name}: the pressure for {57.29577951308232 * one.angle:.4g}° is not a solution: {one.ended.value}"
        for name, each in inversions.items()
        for one in each
        if one.ended is not SearchEnd.YES
    ]
    view = ActuatorView(read.name, inversions=inversions, warnings=warnings)
    content = inversions_json(inversions, read.inputs)
    _write_result(folder, view, content, read.inputs, figures)


def actuator_control(
    spec: _ActuatorPath, out: _OutOfActuator = None, device: Device = "cpu", figures: Figures = ()
) -> None:
    """Run the closed loop of `control`: a reduced model, a plant of another stiffness, noise and delay.

    Writes actuator.html, actuator.json and, for each direction of gravity, every tick as CSV.
    """
    from kolsky.bodies.actuator_control import loop_warnings, run_control
    from kolsky.bodies.actuator_output import loop_columns, loop_json
    from kolsky.bodies.actuator_reading import read_actuator
    from kolsky.report.body_views import ActuatorView

    read = read_actuator(spec, device=device)
    section = read.declared.control
    if section is None:
        raise read.toml.error("control", "is missing", cure='add [control] with angles = ["20 deg"] and most')
    folder = usable_folder(out or read.toml.path.with_suffix("") / "control")
    with read.toml.refusing("control", "cannot be run"):
        closed, reductions = run_control(read.actuator, read.gravities, section)
    warnings = loop_warnings(closed, reductions, section)
    view = ActuatorView(read.name, closed=closed, reductions=reductions, warnings=warnings)
    content = loop_json(closed, reductions, read.inputs)

    ticks = {name: loop_columns(run) for name, run in closed.items()}
    _write_result(folder, view, content, read.inputs, figures, tables=ticks)


def _write_result(
    folder: Path,
    view: "ActuatorView",
    content: dict[str, Any],
    inputs: dict[str, str],
    figures: tuple[str, ...],
    *,
    tables: Mapping[str, Mapping[str, Any]] | None = None,
    files: Files | None = None,
) -> None:
    """Write actuator.html, actuator.json, figures, tables and further files, and print the result."""
    from kolsky.report.pages.bodies import actuator_rows, render_actuator

    page = {"actuator.html": render_actuator(view, inputs), "actuator.json": content}
    write_folder(folder, {**page, **(files or {}), **figure_files(figures, view)}, tables)
    print_result(
        actuator_rows(view), content, files={"page": folder / "actuator.html"}, warnings=view.warnings
    )
