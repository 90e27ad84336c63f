"""`kolsky simulate`: one simulation of a shot, compared with its data."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import AsJson, Mesh, Numbers, Out, ShotPath, SolverOptions


def simulate(
    shot: ShotPath,
    *,
    parameter: Numbers = None,
    mesh: Mesh = "24x32",
    solver: SolverOptions,
    out: Out = None,
    slow: Annotated[
        bool,
        typer.Option("--slow", help="Simulate the quasi-static test instead, as slow as --error requires."),
    ] = False,
    strain: Annotated[
        str,
        typer.Option(
            metavar="SHARE", help="Of --slow: last nominal compression.", show_default="where the shot ends"
        ),
    ] = "",
    error: Annotated[
        str, typer.Option(metavar="SHARE", help="Of --slow: wanted error of the force.", show_default="0.2 %")
    ] = "",
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the deforming mesh for ParaView.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a shot once, e.g. -p stiffness_factor=1.1, and compare it with the data.

    A run that fails is written up to its end; the exit code is then 1. With --slow its specimen is compressed
    without inertia: slow.csv has force, stress and radius over the strain.
    """
    started = perf_counter()
    parameters = texts.values("--parameter", parameter or [])
    elements = texts.mesh("--mesh", mesh)
    if slow:
        wanted = _slow_options(parameters, strain, error, solver, vtu=vtu)
        _slow(shot, out, parameters, elements, wanted, solver.threads, as_json=as_json)
        return
    if strain or error:
        raise InputError(texts.COMMAND_LINE, "--strain and --error belong to --slow", cure="add --slow")
    if vtu and solver.nearly_incompressible:
        raise InputError(
            texts.COMMAND_LINE,
            "--vtu and --nearly-incompressible exclude each other: meshes with different nodes have no "
            "common deformed one",
            cure="leave one out",
        )
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, progress_bars, since

    loaded, folder = load(shot, out, "simulation")
    numerics = solver.numerics(elements)
    from kolsky.base.files import filling, jsonable
    from kolsky.inverse import simulate as simulation
    from kolsky.inverse.result import worst_imbalance
    from kolsky.uncertainty.warnings import (
        folded_warning,
        hourglass_warning,
        past_curve_warning,
        sliding_warning,
    )

    with usable(loaded), progress_bars() as progress:
        progress("simulation", 0, 1)
        run = simulation.simulate(
            loaded, parameters, numerics=numerics, progress=lambda n: progress("simulation", n, 1)
        )
    with filling(folder) as partial:
        simulation.write_simulation(partial, run)
        if vtu:
            from kolsky.report.paraview import write_vtu

            write_vtu(partial, run.response, run.prepared.forward.mesh(numerics).quads)
    share, ending = float(run.response.extrapolated_share[0]), run.response.ending(0)
    warnings = [
        *([] if ending.outcome.ok else [f"the simulation ended {ending.sentence}"]),
        *past_curve_warning(share, float(run.response.largest_strain_measure[0]), run.prepared.checks),
        *hourglass_warning(run.response),
        *folded_warning(
            run.response, run.prepared.forward.mesh(numerics), loaded.interface, list(parameters)
        ),
        *sliding_warning(loaded.interface, list(parameters)),
    ]
    summary = {
        "shot": loaded.name,
        "parameters": run.parameters,
        "outcome": ending.outcome.name,
        **({} if ending.outcome.ok else _failure(ending)),
        "steps": int(run.response.steps[0]),
        "energy_imbalance": worst_imbalance(run.response),
        "artificial_energy": float(run.response.energy.artificial_share()[0]),
        "extrapolated_share": share,
        **({} if run.terms is None else {**vars(run.terms), "phi_units": "phi_force N, phi_shape 1"}),
        "folder": str(folder),
    }
    said = jsonable({**summary, "warnings": warnings}, "simulation") if as_json else None
    print_result(summary, said, rest={"wall time": since(started)}, warnings=warnings)
    if not ending.outcome.ok:
        raise typer.Exit(1)


def _failure(ending: Any) -> dict[str, Any]:
    """When, where and why a run ended."""
    r, y = ending.place
    return {
        "end_time": ending.time,
        "element": ending.element,
        "element_place": {"R": r, "Y": y},
        "cause": ending.outcome.cause,
        "cure": ending.outcome.cure,
    }


SLOW_PARAMETERS = ("stiffness_factor", "friction", "poisson")
"""Parameters that a slow test reads."""


def _slow_options(
    parameters: Mapping[str, float], strain: str, error: str, solver: SolverOptions, *, vtu: bool
) -> tuple[float | None, float]:
    """Last strain, None for the shot's, and wanted error of a slow test."""
    for name in parameters:
        if name not in SLOW_PARAMETERS:
            cure = f"leave it out; a slow test reads {', '.join(SLOW_PARAMETERS)}"
            raise InputError(texts.COMMAND_LINE, f"--parameter {name} has no effect with --slow", cure=cure)
    for field in fields(SolverOptions):
        if field.name != "threads" and getattr(solver, field.name) != field.default:
            option = f"--{field.name.replace('_', '-')}"
            raise InputError(texts.COMMAND_LINE, f"{option} has no effect with --slow", cure="leave it out")
    if vtu:
        raise InputError(texts.COMMAND_LINE, "--vtu has no effect with --slow", cure="leave it out")
    last = None if not strain else texts.physical("--strain", strain, "1", positive=True)
    if last is not None and not last < 1.0:
        raise InputError(
            texts.COMMAND_LINE, "is not allowed", key="--strain", value=strain, allowed="< 100 %"
        )
    return last, 2e-3 if not error else texts.physical("--error", error, "1", positive=True)


def _slow(
    shot: Path,
    out: Path | None,
    parameters: Mapping[str, float],
    mesh: tuple[int, int],
    wanted: tuple[float | None, float],
    threads: int | None,
    *,
    as_json: bool,
) -> None:
    """The quasi-static test of a shot's specimen."""
    started = perf_counter()
    from kolsky.cli.options import load, usable
    from kolsky.cli.terminal import print_result, since

    loaded, folder = load(shot, out, "simulation")
    from kolsky.base.files import filling, jsonable
    from kolsky.inverse import simulate as slow
    from kolsky.material.slow_compression import write_slow_compression

    with usable(loaded):
        found = slow.slow_test_of(
            loaded, parameters, last=wanted[0], error=wanted[1], mesh=mesh, threads=threads
        )
    with filling(folder) as partial:
        write_slow_compression(partial / "slow.csv", found)
    warnings = slow.slow_test_warnings(found)
    summary = {
        "shot": loaded.name,
        **({"parameters": dict(parameters)} if parameters else {}),
        "last_strain": float(found.strain[-1]),
        "last_force": float(found.force[-1]),
        "error": found.errors[-1],
        "duration": f"{found.durations[-1]:.0f} passages of a wave, after {len(found.durations) - 1} shorter",
        "kinetic_share": found.test.kinetic_share,
        "face_difference": found.test.face_difference,
        "extrapolated_share": found.test.past_data,
        "file": str(folder / "slow.csv"),
    }
    listed = {**summary, "durations": found.durations, "errors": found.errors, "warnings": warnings}
    said = jsonable(listed, "slow") if as_json else None
    print_result(summary, said, rest={"wall time": since(started)}, warnings=warnings)
