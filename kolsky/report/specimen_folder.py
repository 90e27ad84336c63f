"""Result folder of `kolsky specimen`: page, tables, HDF5 and VTU."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.files import filling, write_json
from kolsky.bodies import specimen_output
from kolsky.bodies.specimen_studies import StudyRow
from kolsky.equilibrium.solution import Solution
from kolsky.report.body_views import SheetView, SpecimenView
from kolsky.report.figures_alone import save_figures_alone
from kolsky.report.paraview import write_grid


def write_specimen_results(
    folder: Path,
    view: SpecimenView,
    inputs: Mapping[str, str],
    *,
    formats: Sequence[str] = (),
    vtu: bool = False,
    stills: bool = False,
    studies: Mapping[str, Sequence[StudyRow]] | None = None,
) -> None:
    """Write specimen.html, .json, .h5, tables, curves for `identify` and, if asked for, figures and VTU.

    ``inputs``: SHA-256 of the files that were read. ``vtu``: also write the last sample of each test for
    ParaView. ``stills``: also draw it in three dimensions by PyVista. ``studies``: further tables by name.
    """
    from kolsky.report.pages.specimen import write_page

    with filling(folder) as partial:
        specimen_output.write_fits(partial, view.fits)
        write_json(partial / "specimen.json", specimen_output.fits_json(view.fits, inputs))
        write_page(partial / "specimen.html", view, inputs)
        for name, rows in (studies or {}).items():
            specimen_output.write_study(partial / f"{name}.csv", rows)
        if vtu:
            for name, solution in view.solutions.items():
                write_solution_vtu(partial / f"{name}.vtu", solution)
        if stills:
            _write_stills(partial, view.solutions)
        save_figures_alone(partial, view, formats)


def write_sheet_results(
    folder: Path,
    view: SheetView,
    inputs: Mapping[str, str],
    *,
    formats: Sequence[str] = (),
    vtu: bool = False,
    stills: bool = False,
) -> None:
    """Write the results of a sheet, as `write_specimen_results` those of force curves."""
    from kolsky.report.pages.specimen import write_page

    with filling(folder) as partial:
        specimen_output.write_field(partial, view.fit, view.steps)
        write_json(
            partial / "specimen.json",
            specimen_output.field_json(view.fit, view.steps) | {"inputs": dict(inputs)},
        )
        if view.stiffness is not None:
            specimen_output.write_map(partial / "map.csv", view.stiffness, view.mesh)
        write_page(partial / "specimen.html", view, inputs)
        if vtu:
            fields = {
                f"sensitivity of {name} (1/m3)": field
                for name, field in zip(view.fit.constants.free, view.sensitivity, strict=True)
            }
            n = len(view.mesh.points)
            for k, field in enumerate(view.before.field):
                fields[f"before test {k + 1} (1/m3)"] = field.reshape(2, n).T
            write_solution_vtu(partial / "sheet.vtu", view.fit.cost.state.solution, fields)
        if stills:
            _write_stills(partial, {"sheet": view.fit.cost.state.solution})
        save_figures_alone(partial, view, formats)


def _write_stills(folder: Path, solutions: Mapping[str, Solution]) -> None:
    from kolsky.report.films import write_specimen_still

    (folder / "stills").mkdir()
    for name, solution in solutions.items():
        write_specimen_still(folder / "stills" / f"{name}.png", solution)


def write_solution_vtu(
    path: Path, solution: Solution, fields: Mapping[str, FloatArray] | None = None
) -> None:
    """Write the last equilibrium of a solution for ParaView: displacement, nodal forces and further
    fields."""
    mesh, last = solution.model.mesh, solution.reached - 1
    named = {
        "displacement (m)": solution.displacements[last],
        "internal force (N)": solution.forces[last],
        **(fields or {}),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    wide = {name: _wide(values) for name, values in named.items()}
    write_grid(path, _wide(mesh.points), mesh.cells, mesh.element.vtk, wide)


def _wide(values: FloatArray) -> FloatArray:
    """Vectors with three components, shape [n, 3]."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
