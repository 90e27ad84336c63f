"""Page of relaxation, oscillation, temperature sweeps and shots on one axis of time."""

import numpy as np

from kolsky.report.figures import RELAXATIONS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page
from kolsky.results import numbers
from kolsky.studies.rate_dependence import SlowDynamics


def render(result: SlowDynamics, hashes: dict[str, str]) -> str:
    """Return the page as HTML text; see `write_page`."""
    fit = result.fit
    units = {"factor": "", "strength": "", "time": "s"}
    constants = []
    for name, value in zip(fit.names, fit.values, strict=True):
        low, high = fit.interval(name)
        constants.append(
            {
                "name": name,
                "value": numbers.plain(value, 4),
                "low": numbers.plain(low, 3),
                "high": numbers.plain(high, 3),
                "unit": units[name.split()[0]],
                "state": "at a bound" if name in fit.at_bound else "",
            }
        )
    sweeps = []
    for name, one in result.sweeps.items():
        sigma = None if one.covariance is None else np.sqrt(np.diag(one.covariance))
        shown = one.law_holds and sigma is not None and one.C1 is not None and one.C2 is not None
        C1, U1 = numbers.measured(one.C1, 2.0 * sigma[0]) if shown else ("", "")  # type: ignore[index, arg-type]
        C2, U2 = numbers.measured(one.C2, 2.0 * sigma[1]) if shown else ("", "")  # type: ignore[index, arg-type]
        sweeps.append(
            {
                "name": name,
                "reference": f"{one.sweep.reference - 273.15:.4g}",
                "shifts": "determined" if one.determined else "not determined",
                "one": "yes" if one.one_curve else "no",
                "C1": f"{C1} ± {U1}" if shown else "",
                "C2": f"{C2} ± {U2}" if shown else "",
                "law": "holds" if one.law_holds else "not fitted" if one.C1 is None else "does not hold",
            }
        )
    return render_page(
        "relaxation.html",
        kind="Rate dependence of slow tests",
        heading=", ".join(test.label for test in result.tests),
        subject="rate dependence of the material",
        remarks=list(result.remarks),
        sentence=result.sentence,
        constants=constants,
        young=numbers.plain(1e-3 * result.young, 4),
        sweeps=sweeps,
        moduli=[
            {
                "name": one.label,
                "age": f"{one.age.min():.3g} to {one.age.max():.3g}",
                "strain": f"{one.strain.min():.3g} to {one.strain.max():.3g}",
                "modulus": f"{1e-3 * one.modulus.min():.4g} to {1e-3 * one.modulus.max():.4g}",
            }
            for one in result.moduli
        ],
        figures=draw_figures(RELAXATIONS.values(), result),
        settings=[
            ("law", type(result.law).__name__ + ("" if result.declared else ", not declared")),
            ("branches tried", str(len(result.verdict.fits) - 1)),
        ],
        inputs=list(hashes.items()),
    )


write_page = page_writer(render)
