"""Verdicts that a fit does not deserve are withheld, and the reasons are said.

A value is called identified only if the model explains force and outline, and they do not contradict each
other. One that rests on a single channel, which the other cannot check, is named after it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

from kolsky.diagnosis.thresholds import ALONE, CHECKS, CONTRADICTION, LATE, UNEXPLAINED
from kolsky.inverse.fit_results import FORCE, OUTLINE, ClockLag, FitQuality
from kolsky.inverse.result import Estimate, Identification, Verdict
from kolsky.inverse.valleys import VALLEY

ALONE_BY = {FORCE: Verdict.FORCE_ALONE, OUTLINE: Verdict.OUTLINE_ALONE}
"""The verdict on a value that rests on one channel."""
OTHER = {FORCE: OUTLINE, OUTLINE: FORCE}
"""The channel that may check it."""
ROUTES = {FORCE: "force only", OUTLINE: "shape only"}
"""The route of each channel alone."""
WITHHELD = (Verdict.IDENTIFIED, Verdict.FORCE_ALONE, Verdict.OUTLINE_ALONE, Verdict.CONDITIONAL)
"""Verdicts that the fit may overrule; the others say no already."""
LEAST_MARGIN = 25.0
"""Least -2 ln L of the next valley of Poisson's ratio above its own [-]: a coarse mesh's error is worth as
much where the ringing is weak. Of 18 made tests that were looked at the one that ended in a wrong valley has
18, the others have 61 to 690 (docs/validation/coverage.md)."""
EDGE = 1e-4
"""A value this close to an end of the box that was searched, as a share of it, lies there."""
UNITS = {"N": (1.0, "N"), "m": (1e6, "um")}
"""Factor and unit in which a residual is written."""


def judged(result: Identification) -> Identification:
    """The result with verdicts that its goodness of fit allows."""
    estimates = {name: replace(e, outcome=verdict(result, e)) for name, e in result.estimates.items()}
    return replace(result, estimates=estimates)


def verdict(result: Identification, e: Estimate) -> Verdict:
    """The verdict on one parameter, gravest first.

    Not explained, contradicted, not told from a bound of its design or from another valley, of one channel
    alone.
    """
    if e.outcome not in WITHHELD:
        return e.outcome
    if not all(channel.explained for channel in result.fit):
        return Verdict.UNEXPLAINED
    if contradicted(result, e.name):
        return Verdict.CONTRADICTED
    if reaches_bound(result, e):
        return Verdict.BOUND_REACHED
    if e.name == VALLEY and result.surrogate.get("valley_margin", inf) < LEAST_MARGIN:
        return Verdict.OTHER_VALLEY
    if e.outcome is Verdict.IDENTIFIED:
        for channel in result.fit:
            if 1.0 - channel.weight.get(e.name, 0.5) < ALONE and not checked(result, e.name, channel.channel):
                return ALONE_BY[channel.channel]
    return e.outcome


def checked(result: Identification, name: str, channel: str) -> bool:
    """True if the other channel by itself tells a parameter well enough to contradict this one.

    The weights of the data count what errors have in common, and may leave a channel next to no part in the
    answer that alone, with its whole budget, tells the value nearly as well. It checks the value if its
    standard uncertainty is at most `kolsky.diagnosis.thresholds.CHECKS` times the answer's, and its optimum
    lies inside what was searched.
    """
    routes = {route.name: route.sigma.get(name, inf) for route in result.routes}
    joint, other = routes.get("joint", 0.0), routes.get(ROUTES[OTHER[channel]], inf)
    return 0.0 < other <= CHECKS * joint and not route_at_edge(result, name)


def reaches_bound(result: Identification, e: Estimate) -> bool:
    """True if the k = 2 interval reaches past a bound of the parameter's design, which no run has seen."""
    i = result.design.names.index(e.name)
    # The interval that is printed ends where the search did.
    low, high = e.value - 2.0 * e.sigma, e.value + 2.0 * e.sigma
    return low < result.design.lower[i] or high > result.design.upper[i]


def explained(result: Identification) -> bool:
    """True if the model explains every channel, and limits were set."""
    return explains(result.fit)


def explains(fit: Sequence[FitQuality]) -> bool:
    """True if every channel is explained within limits that were set."""
    return bool(fit) and all(f.explained and f.limit < inf for f in fit)


def near_right(fit: Sequence[FitQuality]) -> bool:
    """True if no channel has a misfit from which on values of an input far away are tried.

    Its excess and its slow excess, squared, are at most `kolsky.diagnosis.thresholds.UNEXPLAINED`, and
    limits were set.
    """
    return explains(fit) and all(max(f.excess, f.slow_excess) ** 2 <= UNEXPLAINED for f in fit)


def contradicted(result: Identification, name: str) -> bool:
    """True if force and outline ask for values further apart than `CONTRADICTION` standard uncertainties.

    A channel that cannot tell a value inside the range that was searched contradicts nothing.
    """
    return routes_apart(result, name) > CONTRADICTION and not route_at_edge(result, name)


def routes_apart(result: Identification, name: str) -> float:
    """Force alone minus outline alone over the standard uncertainty of their difference [-]; 0 if unknown."""
    found = result.route_difference
    if found is None or not found.sigma.get(name, 0.0) > 0.0:
        return 0.0
    return abs(found.values[name]) / found.sigma[name]


def route_at_edge(result: Identification, name: str) -> bool:
    """True if force or outline alone end at an edge of the box that was searched."""
    routes = {route.name: route for route in result.routes}
    ends = [routes[key].on_mesh(name) for key in ROUTES.values() if key in routes]
    boxes = [(curve.x[0], curve.x[-1]) for curve in result.curves if curve.parameter == name]
    return any(min(x - low, high - x) <= EDGE * (high - low) for low, high in boxes for x in ends)


def fit_warnings(result: Identification) -> Iterator[str]:
    """Say why a verdict was withheld, that a clock is wrong, and that one channel decides alone."""
    for channel in result.fit:
        if not channel.explained:
            yield unexplained(channel)
    yield from late_clocks(result)
    for name, e in result.estimates.items():
        if e.outcome is Verdict.CONTRADICTED:
            yield (
                f"force and outline ask for values of {name} that are further apart than {CONTRADICTION:g} "
                "standard uncertainties of their difference: at least one input, or the model, is wrong"
            )
    yield from without_a_say(result)


def without_a_say(result: Identification) -> Iterator[str]:
    """Say of which values one channel has no say, where the verdict does not say it already."""
    for channel in result.fit:
        names = [
            name
            for name, e in result.estimates.items()
            if len(result.fit) > 1
            and channel.weight.get(name, 0.5) < ALONE
            and e.outcome not in ALONE_BY.values()
            and not checked(result, name, OTHER[channel.channel])
        ]
        if names:
            other = OTHER[channel.channel]
            shares = ", ".join(f"{100.0 * channel.weight[name]:.2g} %" for name in names)
            yield (
                f"the {channel.channel} carries {shares} of the information on {', '.join(names)}: the "
                f"answer is that of the {other} alone"
            )


def unexplained(channel: FitQuality) -> str:
    """The reason why a fit is refused, in numbers."""
    factor, unit = UNITS[channel.unit]
    reasons = []
    if not channel.excess <= channel.limit:
        reasons.append(
            f"its residual, {factor * channel.residual:.3g} {unit} rms, is {channel.excess:.3g} times what "
            f"noise, inputs and mesh leave where the model is right (at most {channel.limit:g})"
        )
    if not channel.slow_excess <= channel.slow_limit:
        reasons.append(
            f"averaged over an eighth of the window its residual, {factor * channel.slow_residual:.3g} "
            f"{unit} rms, is {channel.slow_excess:.3g} times that (at most {channel.slow_limit:g})"
        )
    return f"the model does not explain the {channel.channel}: {'; '.join(reasons)}; do not use the value"


def late_clocks(result: Identification) -> Iterator[str]:
    """Say which recording is late, if it is beyond its uncertainty and putting it right explains the data.

    Where no lag explains the data another input is wrong, and a lag that fits best is no finding.
    """
    lag = leading_lag(result.clocks)
    if lag is not None and lag.significance > LATE and lag.explains:
        others = {"force": "the motion", "outline": "the flyer", "flyer": "force and outline"}
        late = "late" if lag.lag > 0.0 else "early"
        yield (
            f"the {lag.recording} was recorded {1e6 * abs(lag.lag):.3g} +- {2e6 * lag.sigma:.2g} us (k = 2) "
            f"too {late} against {others[lag.recording]}: check the times of {lag.file} and {lag.key}"
        )


def leading_lag(clocks: tuple[ClockLag, ...]) -> ClockLag | None:
    """The lag that explains most of the misfit; None if none was recorded."""
    return max(clocks, key=lambda lag: lag.evidence, default=None)
