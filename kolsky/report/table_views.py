"""Tables of any result for pandas and xarray: those of its CSV files, by the names of the files.

What a result's own module writes into a folder is written into a passing one and read back: a table in
a notebook and the file of its name cannot differ.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from dic.output.notebook import pandas, xarray
from kolsky.base.files import write_table


class _Writer(NamedTuple):
    """Who writes a result's tables into a folder, and which is meant if none is named."""

    write: Callable[[Path, Any], object]
    main: str


def _waves(folder: Path, found: Any) -> None:
    from kolsky.bars.reduction.output import write_csv

    write_csv(folder, found)


def _rates(folder: Path, found: Any) -> None:
    from kolsky.studies.rates.output import write_csv

    write_csv(folder, found)


def _joint(folder: Path, found: Any) -> None:
    from kolsky.joint.output import write_joint

    write_joint(folder, found)


def _prediction(folder: Path, found: Any) -> None:
    from kolsky.prediction.output import write_tables

    write_tables(folder, found)


def _plan(folder: Path, found: Any) -> None:
    from kolsky.studies.planning.output import write_csv

    write_csv(folder, found)


def _sweep(folder: Path, found: Any) -> None:
    from kolsky.studies.sweep import write_sweep

    write_sweep(folder / "sweep.csv", found)


def _budget(folder: Path, found: Any) -> None:
    from kolsky.studies.budget.output import write_budget

    write_budget(folder / "budget.csv", found)


def _constants(folder: Path, found: Any) -> None:
    from kolsky.specimen.output import write_fits

    write_fits(folder, [found])


def _curve(folder: Path, found: Any) -> None:
    from kolsky.material.reference_curve_files import write_curve

    write_curve(folder / "curve.csv", found)


def _bars_together(folder: Path, found: Any) -> None:
    from kolsky.shot.bars_together import write_residual

    write_residual(folder / "residual.csv", found)


def _laws(folder: Path, found: Any) -> None:
    from kolsky.material.fits.tables import tables

    for name, columns in tables(found).items():
        write_table(folder / f"{name}.csv", columns)


def _relaxation(folder: Path, found: Any) -> None:
    from kolsky.joint.slow_tables import tables

    for name, columns in tables(found).items():
        write_table(folder / f"{name}.csv", columns)


def _field(folder: Path, found: Any) -> None:
    from dic.output.full_field import write_full_field_history

    write_full_field_history(folder / "history.csv", found)


WRITERS = {
    "kolsky.bars.result.ReducedTest": _Writer(_waves, "waves"),
    "kolsky.studies.rates.records.RateReport": _Writer(_rates, "rate_shots"),
    "kolsky.joint.records.JointResult": _Writer(_joint, "joint_parameters"),
    "kolsky.prediction.predict.Prediction": _Writer(_prediction, "signals"),
    "kolsky.studies.planning.plan.Plan": _Writer(_plan, "plan_force"),
    "kolsky.studies.sweep.Sweep": _Writer(_sweep, "sweep"),
    "kolsky.studies.budget.records.Budget": _Writer(_budget, "budget"),
    "kolsky.specimen.fit.SpecimenFit": _Writer(_constants, "constants"),
    "kolsky.material.reference_curve.ReferenceCurve": _Writer(_curve, "curve"),
    "kolsky.bars.guides.bars_together.BarsTogether": _Writer(_bars_together, "residual"),
    "kolsky.material.fits.compare.Comparison": _Writer(_laws, "material_laws"),
    "kolsky.joint.slow_dynamics.SlowDynamics": _Writer(_relaxation, "relaxation_moduli"),
    "dic.full_field.result.FullField": _Writer(_field, "history"),
}
"""Who writes the tables of a type of result, by the type's dotted name; subclasses have the same."""


def writer_of(data: object) -> _Writer | None:
    """Return who writes the tables of a result; None if nobody does."""
    names = (f"{kind.__module__}.{kind.__qualname__}" for kind in type(data).__mro__)
    return next((WRITERS[name] for name in names if name in WRITERS), None)


def table_of(data: object, table: str = "") -> Any:
    """Return a table of a result as pandas reads its file.

    Parameters
    ----------
    data
        A result of one of the types in `WRITERS`.
    table
        Name of the file without ".csv"; the main one if left out.

    Returns
    -------
    pandas.DataFrame
        Units in the headings, SI.

    Raises
    ------
    ValueError
        If the result has no such table.
    ImportError
        If pandas is not installed.
    """
    writer, reader = writer_of(data), pandas()
    assert writer is not None
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        writer.write(folder, data)
        found = {path.stem: path for path in sorted(folder.rglob("*.csv"))}
        if (name := table or writer.main) not in found:
            raise ValueError(f"there is no table {name!r}; choose from {', '.join(found)}")
        return reader.read_csv(found[name])


def dataset_of(data: object, table: str = "") -> Any:
    """Return a table of a result as an xarray dataset over "row"; units are attributes of the variables.

    Raises
    ------
    ValueError
        If the result has no such table.
    ImportError
        If xarray or pandas is not installed.
    """
    frame = table_of(data, table)
    variables: dict[str, Any] = {}
    for heading in frame.columns:
        name, _, unit = str(heading).rpartition(" (")
        known = bool(name) and unit.endswith(")") and name not in variables
        values = ("row", frame[heading].to_numpy(), {"units": unit[:-1]} if known else {})
        variables[name if known else str(heading)] = values
    return xarray().Dataset(variables)
