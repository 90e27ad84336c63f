"""`kolsky sweep`: choose the points, run what no ledger holds, write a row a run and a page."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from kolsky.base.files import filling
from kolsky.cli.progress import paced
from kolsky.cli.work import options
from kolsky.cli.work.designchoice import DesignChoice
from kolsky.cli.work.parts import Arithmetic, load, since, tell, usable
from kolsky.cli.work.sweeprecords import Records
from kolsky.cli.work.workers import Workers
from kolsky.report.formats import FIGURES


def sweep(
    shot: Path,
    *,
    choice: DesignChoice,
    held: Mapping[str, float],
    mesh: tuple[int, int],
    arithmetic: Arithmetic,
    records: Records,
    workers: Workers,
    out: Path | None,
    formats: Sequence[str],
    as_json: bool,
) -> None:
    """`kolsky sweep`."""
    started = perf_counter()
    for name in formats:
        options.one_of("--figures", name, FIGURES)
    chosen = choice.design()
    options.apart("--points" if choice.points else "--vary", chosen.box.names, "--parameter", held)
    points = records.part(chosen)
    loaded, folder = load(shot, out)
    numerics = replace(arithmetic, threads=workers.threads(arithmetic.threads)).numerics(mesh)
    ledger = records.place(folder)
    import numpy as np

    from kolsky.base.json_types import jsonable
    from kolsky.inverse import misfit
    from kolsky.results.summary import failed_runs
    from kolsky.studies import sweep as factorial
    from kolsky.uncertainty.warnings.runs import lost_runs, sliding

    with usable(loaded), records.usable(), workers.executor() as executor, paced() as progress:
        result = factorial.sweep(
            loaded,
            points,
            held=held,
            numerics=numerics,
            ledger=ledger,
            merge=records.merge,
            retry=records.retry,
            executor=executor,
            progress=progress,
        )
    table = result.table
    warnings = [
        *lost_runs(table),
        *sliding(loaded.interface, [*table.names, *held]),
    ]
    from kolsky.report.canvas import save_figures
    from kolsky.report.figures import SWEEPS
    from kolsky.report.pages.sweep import write_page
    from kolsky.studies.sweep_analysis import analyse_sweep

    looked_at = analyse_sweep(result.shot, chosen.box, table)
    with filling(folder) as partial:
        factorial.write_sweep(partial / f"{records.stem}.csv", result)
        write_page(partial / f"{records.stem}.html", looked_at, warnings=warnings)
        if formats:
            save_figures(partial / "figures", looked_at, formats=tuple(formats), registry=SWEEPS)
    completed = len(table.outcomes) - len(table.lost)
    phi = table.phi_force / misfit.SCALE_FORCE + table.phi_shape / misfit.SCALE_SHAPE  # Eq. (M.5)
    seen = bool(np.isfinite(phi).any())
    best = int(np.nanargmin(phi if seen else table.phi_force)) if completed else None
    summary = {
        "shot": result.shot,
        "runs": len(table.outcomes),
        "completed": completed,
        **({"left_out_by_constraints": chosen.settings["refused"]} if choice.where else {}),
        "smallest_phi": float(phi[best]) if best is not None and seen else None,
        **({} if seen or best is None else {"smallest_phi_force": float(table.phi_force[best])}),
        "at": None if best is None else dict(zip(table.names, table.points[best].tolist(), strict=True)),
        "file": str(folder / f"{records.stem}.csv"),
        "page": str(folder / f"{records.stem}.html"),
        **({} if ledger is None else {"ledger": str(ledger)}),
    }
    failed = {"failed_runs": failed_runs(table)}
    said = jsonable({**summary, **failed, "warnings": warnings}, "sweep") if as_json else None
    tell([], summary, said, rest={"wall time": since(started)}, warnings=warnings)
