"""`kolsky simulate`: one simulation of a shot, compared with its data."""

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter

from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.cli.progress import bars
from kolsky.cli.work import options
from kolsky.cli.work.parts import Arithmetic, failure, load, since, tell, usable


def simulate(
    shot: Path,
    *,
    parameters: Mapping[str, float],
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    out: Path | None,
    vtu: bool,
    as_json: bool,
) -> bool:
    """`kolsky simulate`; returns whether the run completed."""
    started = perf_counter()
    if vtu and arithmetic.nearly_incompressible:
        raise InputError(
            options.COMMAND_LINE,
            "--vtu and --nearly-incompressible exclude each other: meshes with different nodes have no "
            "common deformed one",
            cure="leave one out",
        )
    loaded, folder = load(shot, out, "simulation")
    numerics = arithmetic.numerics(mesh)
    from kolsky.base.json_types import jsonable
    from kolsky.inverse import simulate as forward
    from kolsky.inverse.result import worst_imbalance
    from kolsky.uncertainty.warnings.runs import hourglass, past_curve, sliding

    with usable(loaded), bars() as progress:
        progress("simulation", 0, 1)
        run = forward.simulate(
            loaded, parameters, numerics=numerics, progress=lambda n: progress("simulation", n, 1)
        )
    with filling(folder) as partial:
        forward.write_simulation(partial, run)
        if vtu:
            from kolsky.report.paraview import write_vtu

            write_vtu(partial, run.response, run.prepared.forward.mesh(numerics).quads)
    share, ending = float(run.response.extrapolated_share[0]), run.response.ending(0)
    warnings = [
        *([] if ending.outcome.ok else [f"the simulation ended {ending.sentence}"]),
        *past_curve(share, float(run.response.largest_strain_measure[0]), run.prepared.checks),
        *hourglass(run.response),
        *sliding(loaded.interface, list(parameters)),
    ]
    summary = {
        "shot": loaded.name,
        "parameters": run.parameters,
        "outcome": ending.outcome.name,
        **({} if ending.outcome.ok else failure(ending)),
        "steps": int(run.response.steps[0]),
        "energy_imbalance": worst_imbalance(run.response),
        "artificial_energy": float(run.response.energy.artificial_share()[0]),
        "extrapolated_share": share,
        **({} if run.terms is None else {**vars(run.terms), "phi_units": "phi_force N, phi_shape 1"}),
        "folder": str(folder),
    }
    said = jsonable({**summary, "warnings": warnings}, "simulation") if as_json else None
    tell([], summary, said, rest={"wall time": since(started)}, warnings=warnings)
    return ending.outcome.ok
