"""Notebook views of any result: HTML for IPython, tables for pandas and xarray.

The tables are those of the result's CSV files, by the names of the files. The views are functions of the
data, which do not import them; `kolsky.report.ipython` registers them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from dic import output as surface_views
from dic.output import html_table, pandas, xarray
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.base.files import write_table
from kolsky.inverse.result import Identification
from kolsky.results.printed import answer, details
from kolsky.results.tables import tables
from kolsky.shot.records import ShotBase
from kolsky.shot.summary import summarise


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
    from kolsky.results.joint import write_joint

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
    from kolsky.studies.budget.records import write_budget

    write_budget(folder / "budget.csv", found)


def _constants(folder: Path, found: Any) -> None:
    from kolsky.bodies.specimen_output import write_fits

    write_fits(folder, [found])


def _curve(folder: Path, found: Any) -> None:
    from kolsky.material.reference_curve import write_curve

    write_curve(folder / "curve.csv", found)


def _bars_together(folder: Path, found: Any) -> None:
    from kolsky.shot.waves import write_residual

    write_residual(folder / "residual.csv", found)


def _laws(folder: Path, found: Any) -> None:
    from kolsky.material.fits.tables import tables

    for name, columns in tables(found).items():
        write_table(folder / f"{name}.csv", columns)


def _relaxation(folder: Path, found: Any) -> None:
    from kolsky.studies.rate_dependence import tables

    for name, columns in tables(found).items():
        write_table(folder / f"{name}.csv", columns)


def _field(folder: Path, found: Any) -> None:
    from dic.output import write_full_field_history

    write_full_field_history(folder / "history.csv", found)


WRITERS = {
    "kolsky.bars.records.ReducedTest": _Writer(_waves, "waves"),
    "kolsky.studies.rates.records.RateReport": _Writer(_rates, "rate_shots"),
    "kolsky.inverse.joint_result.JointResult": _Writer(_joint, "joint_parameters"),
    "kolsky.prediction.predict.Prediction": _Writer(_prediction, "signals"),
    "kolsky.studies.planning.plan.Plan": _Writer(_plan, "plan_force"),
    "kolsky.studies.sweep.Sweep": _Writer(_sweep, "sweep"),
    "kolsky.studies.budget.records.Budget": _Writer(_budget, "budget"),
    "kolsky.bodies.specimen_fit.SpecimenFit": _Writer(_constants, "constants"),
    "kolsky.material.reference_curve.ReferenceCurve": _Writer(_curve, "curve"),
    "kolsky.bars.guides.propagation.BarsTogether": _Writer(_bars_together, "residual"),
    "kolsky.material.fits.compare.Comparison": _Writer(_laws, "material_laws"),
    "kolsky.studies.rate_dependence.SlowDynamics": _Writer(_relaxation, "relaxation_moduli"),
    "dic.result.FullField": _Writer(_field, "history"),
}
"""Who writes the tables of a type of result, by the type's dotted name; subclasses have the same."""


def _writer_of(data: object) -> _Writer | None:
    """Return who writes the tables of a result; None if nobody does."""
    names = (f"{kind.__module__}.{kind.__qualname__}" for kind in type(data).__mro__)
    return next((WRITERS[name] for name in names if name in WRITERS), None)


def table_of(data: object, table: str = "") -> Any:
    """Return a table of a result as pandas reads its file.

    ``data``: a result of one of the types in `WRITERS`. ``table``: name of the file without ".csv"; the main
    one if left out. Returns: units in the headings, SI. Raises ValueError if the result has no such table.
    Raises ImportError if pandas is not installed.
    """
    writer, reader = _writer_of(data), pandas()
    assert writer is not None
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        writer.write(folder, data)
        found = {path.stem: path for path in sorted(folder.rglob("*.csv"))}
        if (name := table or writer.main) not in found:
            raise ValueError(f"there is no table {name!r}; choose from {', '.join(found)}")
        return reader.read_csv(found[name])


def _dataset_of(data: object, table: str = "") -> Any:
    """Return a table of a result as an xarray dataset over "row"; units are attributes of the variables."""
    frame = table_of(data, table)
    variables: dict[str, Any] = {}
    for heading in frame.columns:
        name, _, unit = str(heading).rpartition(" (")
        known = bool(name) and unit.endswith(")") and name not in variables
        values = ("row", frame[heading].to_numpy(), {"units": unit[:-1]} if known else {})
        variables[name if known else str(heading)] = values
    return xarray().Dataset(variables)


__all__ = ["html", "to_dataframe", "to_xarray"]


@singledispatch
def html(data: object) -> str:
    """Return a shot, a measured surface or an identification as an HTML table.

    Raises
    ------
    TypeError
        If it is something else.
    """
    raise TypeError(_no_view(data, "a notebook"))


@singledispatch
def to_dataframe(data: object, table: str = "") -> Any:
    """Return a shot, a measured surface or any result as a pandas table (SI, units in the headers).

    Parameters
    ----------
    data
        A shot: one row per value of its file. A surface: one row per point and frame. An identification:
        the `table` of that name.
    table
        Of an identification: "estimates" (the default), "routes", "force", "profile", "design" or "energy";
        the last four are the CSV files of the same names. Of any other result (waves, rates, several shots,
        a prediction, a plan, a sweep, a budget, constants, a reference curve, a displacement field) the name
        of one of its CSV files, without ".csv"; the main one if left out.

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    ValueError
        If there is no such table.
    TypeError
        If it is something else.
    ImportError
        If pandas is not installed.
    """
    if _writer_of(data) is None:
        raise TypeError(_no_view(data, "pandas"))
    return table_of(data, table)


@singledispatch
def to_xarray(data: object, table: str = "") -> Any:
    """Return a measured surface, an identification or a table of any other result as an xarray dataset, SI.

    An identification has measured and simulated force over "force_time" [s], outline over "point", and the
    energies of the simulation over "surface_time" [s]; its attributes are the estimates. A surface has
    "frame", "point" and "component"; lost points are NaN, with the cause in `outcome`. Of any other result
    the `table` of `to_dataframe` is over "row".

    Parameters
    ----------
    data
        As of `to_dataframe`.
    table
        Which of its tables, as of `to_dataframe`; the main one if left out.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    TypeError
        If it is something else.
    ImportError
        If xarray is not installed.
    """
    if _writer_of(data) is None:
        raise TypeError(_no_view(data, "xarray"))
    return _dataset_of(data, table)


@html.register
def _(data: ShotBase) -> str:
    rows = [(f"{e.section}, {e.name.replace('_', ' ')}", e.written()) for e in summarise(data)]
    return html_table(f"Shot {data.name}", rows)


@html.register
def _(data: SurfaceHistory) -> str:
    return html_table("Measured surface", surface_views.facts(data))


@html.register
def _(data: Identification) -> str:
    rows = [*details(data).items(), *(("warning", text) for text in data.warnings)]
    return html_table("; ".join(answer(estimate) for estimate in data.estimates.values()), rows)


@to_dataframe.register
def _(data: ShotBase, table: str = "") -> Any:
    entries = summarise(data)
    names = ("section", "name", "value", "unit")
    return pandas().DataFrame({n: [getattr(e, n) for e in entries] for n in names})


@to_dataframe.register
def _(data: SurfaceHistory, table: str = "") -> Any:
    return surface_views.to_dataframe(data)


@to_dataframe.register
def _(data: Identification, table: str = "estimates") -> Any:
    known = {**_summaries(data), **tables(data)}
    if table not in known:
        raise ValueError(f"there is no table {table!r}; choose from {', '.join(known)}")
    return pandas().DataFrame(dict(known[table]))


@to_xarray.register
def _(data: SurfaceHistory, table: str = "") -> Any:
    return surface_views.to_xarray(data)


@to_xarray.register
def _(data: Identification, table: str = "") -> Any:
    c, ledger = data.comparison, data.response.energy
    newton, metre = {"units": "N"}, {"units": "m"}
    energies = {
        f"energy_{name}": ("surface_time", getattr(ledger, name)[0], {"units": "J"}) for name in vars(ledger)
    }
    return xarray().Dataset(
        {
            "force_measured": ("force_time", c.force_measured, newton),
            "force_sigma": ("force_time", c.force_sigma, newton),
            "force_simulated": ("force_time", c.force_model, newton),
            "frame": ("point", c.centre_line.frame),
            "time": ("point", c.centre_line.time, {"units": "s"}),
            "y": ("point", c.centre_line.y, metre),
            "Z_measured": ("point", c.centre_line.Z, metre),
            "Z_sigma": ("point", c.centre_line.sigma, metre),
            "Z_simulated": ("point", c.Z_model, metre),
            **energies,
        },
        coords={
            "force_time": ("force_time", c.force_time, {"units": "s"}),
            "surface_time": ("surface_time", data.response.surface_times, {"units": "s"}),
        },
        attrs={
            "shot": data.shot,
            **{name: e.value for name, e in data.estimates.items()},
            **{f"{name}_sigma": e.sigma for name, e in data.estimates.items()},
        },
    )


def _summaries(found: Identification) -> dict[str, dict[str, Any]]:
    estimates, routes = list(found.estimates.values()), found.routes
    names = list(found.estimates)
    return {
        "estimates": {
            "parameter": names,
            "unit": [e.unit for e in estimates],
            "value": [e.value for e in estimates],
            "sigma": [e.sigma for e in estimates],
            "lower (k = 2)": [e.interval[0] for e in estimates],
            "upper (k = 2)": [e.interval[1] for e in estimates],
            "sigma noise": [e.sigma_noise for e in estimates],
            "sigma mesh and step": [e.sigma_numerical for e in estimates],
            "verdict": [e.outcome.value for e in estimates],
        },
        "routes": {
            "route": [route.name for route in routes],
            **{name: [route.parameters[name] for route in routes] for name in names},
            **{f"sigma {name}": [route.sigma.get(name, float("nan")) for route in routes] for name in names},
            "cost": [route.cost for route in routes],
        },
    }


def _no_view(data: object, where: str) -> str:
    return f"{type(data).__name__} has no view for {where}; shots, surfaces and results have one"
