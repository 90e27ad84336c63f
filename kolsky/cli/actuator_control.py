"""`kolsky actuator control`: the closed loop with a simulated plant, and how long its ticks take."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.cli import texts
from kolsky.cli.actuator_simulate import ActuatorPath, OutOfActuator
from kolsky.cli.options import AsJson, Device, Figures


def actuator_control(
    spec: ActuatorPath,
    out: OutOfActuator = None,
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
    from kolsky.actuator.benchmark import loop_warnings, run_control
    from kolsky.actuator.output import loop_json, write_loop
    from kolsky.actuator.reading import read_actuator
    from kolsky.base.files import usable_folder
    from kolsky.cli.actuator_result import write_result
    from kolsky.report.actuator_view import ActuatorView

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

    write_result(
        folder, view, said, read.inputs, formats=formats, as_json=as_json, started=started, more=ticks
    )  # fmt: skip
