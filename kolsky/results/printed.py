"""Results as lines of plain text for a terminal of 80 columns."""

from kolsky.diagnosis.causes import percent, sentence
from kolsky.inverse.parameters import PARAMETERS, reference_words
from kolsky.inverse.result import Estimate, Identification, Method, Route, Verdict
from kolsky.pictures.specimen_length import LengthByPictures, length_words
from kolsky.results import numbers
from kolsky.results.display import estimate_in_display_units, in_display_units
from kolsky.results.identification_rows import printed_fit, printed_sensitivities
from kolsky.results.nomenclature import factor_of
from kolsky.results.numbers import plain_sentence
from kolsky.shot.inputs import INPUTS
from kolsky.uncertainty.declarations import relative_moves, taken_as_exact

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


MOST_PARTS = 4
"""So many parts of an uncertainty are printed, the largest first."""


def variance_shares(found: Identification, name: str) -> dict[str, float]:
    """Return the share of each source in a parameter's variance, the largest first; they add up to one.

    A declared input's part is the square of the shift that it causes, since inputs are independent.
    """
    e = found.estimates[name]
    parts = {"noise": e.sigma_noise**2, "mesh and step": e.sigma_numerical**2}
    parts |= {part.key: part.shifts.get(name, 0.0) ** 2 for part in found.systematic}
    total = sum(parts.values())
    if total <= 0.0:
        return {}
    return {key: part / total for key, part in sorted(parts.items(), key=lambda one: -one[1]) if part > 0.0}


def summary(found: Identification) -> dict[str, str]:
    """Return what dominates the first parameter's uncertainty, the likely causes of a misfit, and what to do
    next: names and values."""
    first = next(iter(found.estimates))
    largest = list(variance_shares(found, first).items())[:MOST_PARTS]
    rows = {}
    if largest:
        words = ", ".join(f"{key.replace('_', ' ')} {100.0 * share:.2g} %" for key, share in largest)
        rows[f"variance of {plain_symbol(first)}"] = plain_sentence(words)
    return {**rows, **_causes(found), "next": plain_sentence(_next_step(found, [key for key, _ in largest]))}


def _next_step(found: Identification, largest: list[str]) -> str:
    """What the user should do with the answer, in one sentence."""
    if any(not one.explained for one in found.fit):
        cause = next((c.key for c in found.causes if c.named), None)
        check = f"check {cause}" if cause else "check the inputs"
        return f"{check}; the report compares force and outline with the model"
    if any(e.outcome is not Verdict.IDENTIFIED for e in found.estimates.values()):
        return "see the warnings; a parameter that is known can be held (--hold NAME=VALUE)"
    if open_ := taken_as_exact(found.systematic):
        worst = max(open_, key=lambda part: max(map(abs, relative_moves(part, _values(found)).values())))
        return f"declare {worst.key} and {len(open_) - 1} more in [uncertainty]: they are taken as exact"
    declared = [key for key in largest if key in INPUTS]
    return f"a better known {declared[0].replace('_', ' ')} narrows the interval most" if declared else "none"


def _values(found: Identification) -> dict[str, float]:
    return {name: e.value for name, e in found.estimates.items()}


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
