"""`kolsky actuator simulate`: the bend of a pressurised actuator."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.cli import texts
from kolsky.cli.options import AsJson, Device, Figures

ActuatorPath = Annotated[
    Path, typer.Argument(metavar="SPEC", help="A SPEC.toml: geometry, material, gravity, pressures.")
]
OutOfActuator = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SPEC's name/COMMAND"),
]


def actuator_simulate(
    spec: ActuatorPath,
    out: OutOfActuator = None,
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
    from kolsky.actuator.marker_reading import compared_markers
    from kolsky.actuator.output import bends_json, markers_json, write_bends, write_markers, write_motion
    from kolsky.actuator.reading import read_actuator
    from kolsky.actuator.study import move, simulate_all, warnings_of
    from kolsky.base.files import usable_folder
    from kolsky.cli.actuator_result import write_result
    from kolsky.report.actuator_film import write_actuator_film
    from kolsky.report.actuator_view import ActuatorView
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

    write_result(
        folder, view, said, inputs, formats=formats, as_json=as_json, started=started, more=tables,
    )  # fmt: skip
