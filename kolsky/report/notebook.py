"""Notebook views of any result: HTML for IPython, tables for pandas and xarray.

The tables are those of the result's CSV files, by the names of the files. The views are functions of the
data, which do not import them; `kolsky.report.ipython` registers them.
"""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

from dic import output as surface_views
from dic.output import html_table, pandas, xarray
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.base.files import write_table
from kolsky.inverse.result import Identification
from kolsky.results.printed import answer, details
from kolsky.results.tables import tables
from kolsky.shot.records import ShotBase
from kolsky.shot.summary import summarise


class _Tables(NamedTuple):
    """How the tables of a type of result are written."""

    function: str
    """Dotted name of the function that makes or writes the tables."""
    main: str
    """Name of the table that is meant if none is named."""
    takes: Literal["folder", "folder and list", "file", "columns"] = "folder"
    """What the function takes: a folder and the result or a list of results, the file of the only table and
    the result, or the result alone ("columns"), for which it returns the columns of every table."""


TABLES = {
    "kolsky.bars.records.ReducedTest": _Tables("kolsky.bars.reduction.output.write_csv", "waves"),
    "kolsky.studies.rates.records.RateReport": _Tables("kolsky.studies.rates.output.write_csv", "rate_shots"),
    "kolsky.inverse.joint_result.JointResult": _Tables(
        "kolsky.results.joint.write_joint", "joint_parameters"
    ),
    "kolsky.prediction.predict.Prediction": _Tables("kolsky.prediction.output.write_tables", "signals"),
    "kolsky.studies.planning.plan.Plan": _Tables("kolsky.studies.planning.output.write_csv", "plan_force"),
    "kolsky.studies.sweep.Sweep": _Tables("kolsky.studies.sweep.write_sweep", "sweep", "file"),
    "kolsky.studies.budget.records.Budget": _Tables(
        "kolsky.studies.budget.records.write_budget", "budget", "file"
    ),
    "kolsky.bodies.specimen_fit.SpecimenFit": _Tables(
        "kolsky.bodies.specimen_output.write_fits", "constants", "folder and list"
    ),
    "kolsky.material.reference_curve.ReferenceCurve": _Tables(
        "kolsky.material.reference_curve.write_curve", "curve", "file"
    ),
    "kolsky.bars.guides.propagation.BarsTogether": _Tables(
        "kolsky.shot.waves.write_residual", "residual", "file"
    ),
    "kolsky.material.fits.compare.Comparison": _Tables(
        "kolsky.material.fits.tables.tables", "material_laws", "columns"
    ),
    "kolsky.studies.rate_dependence.SlowDynamics": _Tables(
        "kolsky.studies.rate_dependence.tables", "relaxation_moduli", "columns"
    ),
    "dic.result.FullField": _Tables("dic.output.write_full_field_history", "history", "file"),
}
"""How the tables of a type of result are written, by the type's dotted name; subclasses have the same."""


def _known_tables(data: object) -> _Tables | None:
    """Return how the tables of a result are written; None if it has none."""
    names = (f"{kind.__module__}.{kind.__qualname__}" for kind in type(data).__mro__)
    return next((TABLES[name] for name in names if name in TABLES), None)


def _write_tables(known: _Tables, folder: Path, data: Any) -> None:
    """Write the tables of a result into a folder."""
    module, _, name = known.function.rpartition(".")
    function = getattr(import_module(module), name)
    match known.takes:
        case "folder":
            function(folder, data)
        case "folder and list":
            function(folder, [data])
        case "file":
            function(folder / f"{known.main}.csv", data)
        case "columns":
            for table, columns in function(data).items():
                write_table(folder / f"{table}.csv", columns)


def table_of(data: object, table: str = "") -> Any:
    """Return a table of a result as pandas reads its file.

    ``data``: a result of one of the types in `TABLES`. ``table``: name of the file without ".csv"; the main
    one if left out. Returns: units in the headings, SI. Raises ValueError if the result has no such table.
    Raises ImportError if pandas is not installed.
    """
    known, reader = _known_tables(data), pandas()
    assert known is not None
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _write_tables(known, folder, data)
        found = {path.stem: path for path in sorted(folder.rglob("*.csv"))}
        if (name := table or known.main) not in found:
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
    if _known_tables(data) is None:
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
    if _known_tables(data) is None:
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
