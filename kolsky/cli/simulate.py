"""`kolsky simulate`: one simulation of a shot, compared with its data."""

from time import perf_counter
from typing import Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.options import SOLVER_DEFAULTS, AsJson, Mesh, Numbers, Out, ShotPath, SolverOptions


def simulate(
    shot: ShotPath,
    parameter: Numbers = None,
    mesh: Mesh = "24x32",
    solver: SolverOptions = SOLVER_DEFAULTS,
    out: Out = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="Also write the deforming mesh for ParaView.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a shot once, e.g. -p stiffness_factor=1.1, and compare it with the data.

    A run that fails is written up to its end; the exit code is then 1.
    """
    started = perf_counter()
    parameters = texts.values("--parameter", parameter or [])
    elements = texts.mesh("--mesh", mesh)
    if vtu and solver.nearly_incompressible:
        raise InputError(
            texts.COMMAND_LINE,
            "--vtu and --nearly-incompressible exclude each other: meshes with different nodes have no "
            "common deformed one",
            cure="leave one out",
        )
    from kolsky.cli.inputs import load, usable
    from kolsky.cli.terminal import print_result, progress_bars, since

    loaded, folder = load(shot, out, "simulation")
    numerics = solver.numerics(elements)
    from kolsky.base.files import filling
    from kolsky.base.json_types import jsonable
    from kolsky.inverse import simulate as simulation
    from kolsky.inverse.result import worst_imbalance
    from kolsky.uncertainty.warnings.runs import folded, hourglass, past_curve, sliding

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
        *past_curve(share, float(run.response.largest_strain_measure[0]), run.prepared.checks),
        *hourglass(run.response),
        *folded(run.response, run.prepared.forward.mesh(numerics), loaded.interface, list(parameters)),
        *sliding(loaded.interface, list(parameters)),
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
