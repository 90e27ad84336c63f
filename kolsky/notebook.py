"""How shots and answers show themselves in a notebook, and as tables of pandas or xarray."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dic.notebook import html_table, pandas, xarray

if TYPE_CHECKING:
    from kolsky.identification import Identification
    from kolsky.shots import ShotBase

__all__ = ["IdentificationInNotebook", "ShotInNotebook"]


class ShotInNotebook:
    """What a shot gets from here."""

    def __repr__(self: Any) -> str:
        return f"{type(self).__name__}({self.name!r}, {len(self.inputs)} files in {str(self.folder)!r})"

    def _repr_html_(self: Any) -> str:
        rows = [(f"{e.section}, {e.name.replace('_', ' ')}", e.written()) for e in _entries(self)]
        return html_table(f"Shot {self.name}", rows)

    def to_dataframe(self: Any) -> Any:
        """What was understood of the shot, a row a value: section, name, value (SI), unit.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        entries = _entries(self)
        names = ("section", "name", "value", "unit")
        return pandas().DataFrame({n: [getattr(e, n) for e in entries] for n in names})


class IdentificationInNotebook:
    """What an identification gets from here."""

    def __repr__(self: Any) -> str:
        return f"Identification({self.shot!r}: {'; '.join(_answers(self))})"

    def _repr_html_(self: Any) -> str:
        from kolsky.report.printed import details

        rows = [*details(self).items(), *(("warning", text) for text in self.warnings)]
        return html_table("; ".join(_answers(self)), rows)

    def to_dataframe(self: Any, table: str = "estimates") -> Any:
        """One table of the result, SI, units in the headers.

        Parameters
        ----------
        table
            "estimates", "routes", "force", "profile", "design" or "energy"; the last four are the CSV files
            of the same names.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ValueError
            If there is no such table.
        ImportError
            If pandas is not installed.
        """
        tables = {**_summaries(self), **_tables(self)}
        if table not in tables:
            raise ValueError(f"there is no table {table!r}; choose from {', '.join(tables)}")
        return pandas().DataFrame(dict(tables[table]))

    def to_xarray(self: Any) -> Any:
        """The check run beside the data as one dataset, SI: force over time, outline by points, energies.

        Returns
        -------
        xarray.Dataset
            Dimensions "force_time" [s], "point" (outline points), "surface_time" [s]; the estimates are
            its attributes.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        c, ledger = self.comparison, self.response.energy
        newton, metre = {"units": "N"}, {"units": "m"}
        energies = {
            f"energy_{name}": ("surface_time", getattr(ledger, name)[0], {"units": "J"})
            for name in vars(ledger)
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
                "surface_time": ("surface_time", self.response.surface_times, {"units": "s"}),
            },
            attrs={
                "shot": self.shot,
                **{name: e.value for name, e in self.estimates.items()},
                **{f"{name}_sigma": e.sigma for name, e in self.estimates.items()},
            },
        )


def _entries(shot: ShotBase) -> list[Any]:
    from kolsky.shots.summary import summarise

    return summarise(shot)


def _answers(found: Identification) -> list[str]:
    from kolsky.report.printed import answer

    return [answer(estimate) for estimate in found.estimates.values()]


def _tables(found: Identification) -> Mapping[str, Mapping[str, Any]]:
    from kolsky.results import tables

    return tables(found)


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
