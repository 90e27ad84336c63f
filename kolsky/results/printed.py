"""Results as lines of plain text for a terminal of 80 columns."""

from kolsky.diagnosis.causes import percent, sentence
from kolsky.inverse.parameters import PARAMETERS, reference_words
from kolsky.inverse.result import Estimate, Identification, Method, Route, Verdict
from kolsky.pictures.specimen_length import LengthByPictures, length_words
from kolsky.results import numbers
from kolsky.results.display import estimate_in_display_units, in_display_units
from kolsky.results.identification_rows import held_line, printed_fit, printed_sensitivities
from kolsky.results.nomenclature import factor_of
from kolsky.results.numbers import plain_sentence

ROUTES = {"force only": "force only", "shape only": "outline only", "paper": "cost Phi, Eq. (M.5)"}


def answer(e: Estimate) -> str:
    """Return an estimate as one line, "m = 1.1220 ± 0.0040 (k = 2)"; also the verdict unless identified."""
    e = estimate_in_display_units(e)
    value, uncertainty = numbers.measured(e.value, 2.0 * e.sigma)
    unit = "" if e.unit == "1" else f" {plain_sentence(e.unit)}"
    line = f"{plain_symbol(e.name)} = {plain_sentence(value)} ± {plain_sentence(uncertainty)}{unit} (k = 2)"
    if e.outcome is Verdict.NOT_SEEN:
        low, high = (plain_sentence(numbers.like(end, 2.0 * e.sigma)) for end in e.interval)
        line = f"{plain_symbol(e.name)} = {low} to {high}{unit} (k = 2)"
    return line if e.outcome is Verdict.IDENTIFIED else f"{line}: {e.outcome.value.upper()}"


def details(found: Identification) -> dict[str, str]:
    """Return verdict, interval, uncertainties, optima of all routes, fit and clocks: names and values."""
    found = in_display_units(found)
    rows = [("shot", found.shot)]
    reference = reference_words((*found.estimates, *found.fixed))
    if reference:
        rows.append(("m refers to", plain_sentence(reference)))
    if "specimen_length" in found.provenance:
        length = LengthByPictures(**found.provenance["specimen_length"])
        rows.append(("specimen's length", plain_sentence(length_words(length))))
    for name, e in found.estimates.items():
        symbol, U = plain_symbol(name), 2.0 * e.sigma
        symbol += "" if e.unit == "1" else f" ({plain_sentence(e.unit)})"
        low, high = (plain_sentence(numbers.like(end, U)) for end in e.interval)
        rows.append((f"{symbol}, verdict", f"{name}: {e.outcome.value}"))
        rows.append((f"{symbol}, interval", f"{low} to {high}"))
        rows.append((f"{symbol}, u noise", f"{e.sigma_noise:.2g}"))
        rows.append((f"{symbol}, u mesh and step", f"{e.sigma_numerical:.2g}"))
        if e.mesh_correction:
            shown = plain_sentence(numbers.part(e.mesh_correction, U))
            rows.append((f"{symbol}, on the refined mesh", f"{plain_sentence(numbers.like(e.on_mesh, U))}"))
            rows.append((f"{symbol}, corrected for the mesh by", shown))
        if e.sigma_systematic > 0.0:
            rows.append((f"{symbol}, u declared", f"{e.sigma_systematic:.2g}"))
        rows += [(f"{symbol}, data say", p.verdict) for p in found.profiles if p.name == name]
        rows += [
            (f"{symbol}, {ROUTES[route.name]}", _route_line(route, name, U))
            for route in found.routes
            if route.name in ROUTES
        ]
        rows += [
            (f"{symbol}, {method.name}", _distant_lines(method, name, U)) for method in found.methods[1:]
        ]
        if found.held_answer is not None and found.held_answer.name == name:
            rows.append((f"{symbol}, others held", plain_sentence(held_line(found.held_answer))))
    symbols = {name: plain_symbol(name) for name in found.estimates}
    causes = _causes(found)
    return {**dict(rows), **printed_fit(found, symbols), **causes, **printed_sensitivities(found, symbols)}


def _causes(found: Identification) -> dict[str, str]:
    """Likely causes of a misfit, the most likely first; nothing where there is none."""
    rows = {}
    for number, cause in enumerate((c for c in found.causes if c.named), start=1):
        solved = ", ".join(
            f"{plain_symbol(name)} = {value * factor_of(name):.5g} identified with it"
            for name, value in cause.solved.items()
        )
        said = f"{sentence(cause)} explains {percent(cause.explained)}" + (f"; {solved}" if solved else "")
        rows[f"likely cause {number}, {cause.key}"] = plain_sentence(said)
    return rows


def _distant_lines(method: Method, name: str, U: float) -> str:
    value, distance = numbers.like(method.values[name], U), numbers.plain(method.distances[name], 2)
    return f"{plain_sentence(value)}, {plain_sentence(distance)} U from the answer" + (
        "" if method.converged else ", not at rest"
    )


def _route_line(route: Route, name: str, U: float) -> str:
    value = route.parameters[name]
    if name not in route.sigma:
        return plain_sentence(numbers.like(value, U))
    best, uncertainty = numbers.measured(value, 2.0 * route.sigma[name])
    return f"{plain_sentence(best)} ± {plain_sentence(uncertainty)}"


def plain_symbol(name: str) -> str:
    """Return the symbol of a parameter in plain text."""
    return PARAMETERS[name].symbol if name in PARAMETERS else name
