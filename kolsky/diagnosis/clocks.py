"""Lags of the clocks: how late force, outline and flyer were recorded, from the model's own residual.

A flyer recorded late makes the model late, and force and outline early alike. Each lag is fitted alone
(`kolsky.diagnosis.lag_fit`) with the effect of the free parameters taken as linear. Where the lag that leads
is beyond its uncertainty and yet does not explain the data, the wrong clock may have driven the parameters
further than that holds: the solver is run again where the fit has moved them, and with the others than the
stiffness at their declared values, for a wrong clock may have led them into another valley. What rings does
so at another frequency there: the effect of the parameters is found anew by runs beside each point.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.lag_fit import (
    FittedLag,
    Shifted,
    first_lag,
    fit_lag,
    late_prediction,
    without_lag,
)
from kolsky.diagnosis.thresholds import LATE
from kolsky.inverse.fit_results import ClockLag
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.shot.records import Shot

FORCE, OUTLINE, FLYER = "force", "outline", "flyer"
DIRECTIONS = {FORCE: (1.0, 0.0), OUTLINE: (0.0, 1.0), FLYER: (-1.0, -1.0)}
"""By how much force and outline are late if a recording is late by one."""
STIFFNESS = "stiffness_factor"
"""The parameter of which a shot declares nothing."""
TURNS = 3
"""Most rounds of runs of their own."""
BESIDE = 1e-3
"""Distance of the runs that show a parameter's effect, over its range [-]."""
RIVAL = 0.5
"""Lags with at least this share of the leading one's evidence are followed too."""
STILL = 1e-4
"""Parameters that all move by less, relative to their size, are run no more."""


@dataclass(frozen=True)
class Reruns:
    """The solver, for lags that a linear map does not reach."""

    x: FloatArray
    """The optimum, shape [d]."""
    declared: FloatArray
    """What the shot declares of the free parameters, NaN where that is to be found, shape [d]."""
    lower: FloatArray
    """Lower bounds of the free parameters, shape [d]."""
    upper: FloatArray
    """Upper bounds, shape [d]."""
    run: Callable[[FloatArray], Response]
    """Runs on the refined mesh at points of shape [n, d]."""

    @classmethod
    def of(cls, stages: StagedRuns, x: FloatArray) -> "Reruns":
        """Those of an identification whose optimum is x, shape [d]."""
        box, settings = stages.box, stages.settings
        shot, numerics = stages.prepared.forward.shot, settings.numerics.with_mesh(settings.refined_mesh)
        declared = [np.nan if n == STIFFNESS else PARAMETERS[n].held(shot) for n in box.names]
        return cls(
            x=x,
            declared=np.array(declared),
            lower=np.array(box.lower),
            upper=np.array(box.upper),
            run=lambda points: stages.run("clocks", points, numerics)[0],
        )

    def starts(self, moved: FloatArray) -> list[FloatArray]:
        """Where the solver is run first: moved parameters, and the declared ones where they differ."""
        point = self.inside(moved)
        other = self.inside(np.where(np.isfinite(self.declared), self.declared, moved))
        return [point] if np.allclose(point, other, rtol=STILL, atol=0.0) else [point, other]

    def beside(self, point: FloatArray) -> FloatArray:
        """The point, then one beside it for each parameter and inside the box too, shape [d + 1, d]."""
        step = BESIDE * (self.upper - self.lower)
        step = np.where(point + step > self.upper, -step, step)
        return np.asarray(point + np.concatenate([np.zeros((1, len(point))), np.diag(step)]))

    def inside(self, point: FloatArray) -> FloatArray:
        """The point inside the box."""
        return np.asarray(np.clip(point, self.lower, self.upper))


def first_lags(response: Response, objective: Objective, jacobian: FloatArray) -> dict[str, float]:
    """Where the search for each lag begins [s], by recording; arguments as of `clock_lags`.

    It is most of what `clock_lags` does, and needs nothing but the answer: of use beside other work.
    """
    shifted = late_prediction(response, objective)
    return {
        name: first_lag(objective, shifted, lambda _: jacobian, DIRECTIONS[name])
        for name in _recordings(objective)
    }


def _recordings(objective: Objective) -> tuple[str, ...]:
    return tuple(DIRECTIONS) if objective.observations.has_shape else (FORCE,)


def clock_lags(
    shot: Shot,
    response: Response,
    objective: Objective,
    jacobian: FloatArray,
    changes: Mapping[str, FloatArray],
    *,
    first: Mapping[str, float] | None = None,
    again: Reruns | None = None,
) -> tuple[ClockLag, ...]:
    """Lags of force, outline and flyer, each against the two others.

    Parameters
    ----------
    shot
        The shot, for the names of files and keys.
    response
        The run at the optimum.
    objective
        With the discrepancies of the optimum.
    jacobian
        Of the data vector by the free parameters, shape [k, d].
    changes
        As of `kolsky.diagnosis.fit_quality.fit_quality`.
    first
        What `first_lags` gives, where it is known.
    again
        The solver, for lags that the linear map does not reach; they are left as they are without.

    Returns
    -------
    tuple of ClockLag
        The force's first; without an outline only that.
    """
    shifted, found = late_prediction(response, objective), []
    start = first or {}
    before = without_lag(objective, shifted, lambda _: jacobian)

    def fitted(name: str, seen: Shifted, slope: Shifted, first: float | None = None) -> FittedLag:
        return fit_lag(objective, seen, slope, DIRECTIONS[name], changes, before=before, first=first)

    def refitted(name: str, points: FloatArray, runs: Sequence[Response]) -> FittedLag:
        seen = [late_prediction(run, objective) for run in runs]
        return fitted(name, seen[0], slopes(points, seen))

    fits = {
        name: fitted(name, shifted, lambda _: jacobian, start.get(name)) for name in _recordings(objective)
    }
    if again is not None:
        fits = follow(fits, again, refitted)
    for name, fit in fits.items():
        file, key = origin(shot, name)
        found.append(
            ClockLag(
                recording=name,
                lag=fit.lag,
                sigma=fit.sigma if fit.settled else float("nan"),
                evidence=fit.evidence,
                explains=fit.explains,
                file=file,
                key=key,
            )
        )
    return tuple(found)


def slopes(points: FloatArray, seen: Sequence[Shifted]) -> Shifted:
    """Effect of each parameter on late recordings, shape [k, d]; none on a point that a run does not reach.

    Parameters
    ----------
    points
        As of `Reruns.beside`, shape [d + 1, d].
    seen
        The predictions there, length d + 1.
    """
    steps = np.diag(points[1:] - points[0])

    def slope(lags: FloatArray) -> FloatArray:
        first, *others = (one(lags) for one in seen)
        return np.nan_to_num((np.array(others) - first) / steps[:, None]).T

    return slope


def follow(
    fits: Mapping[str, FittedLag],
    again: Reruns,
    refit: Callable[[str, FloatArray, Sequence[Response]], FittedLag],
) -> dict[str, FittedLag]:
    """The lags with runs of their own, where the leading one is significant and explains nothing.

    Parameters
    ----------
    fits
        By recording, the lags from the run at the optimum.
    again
        The solver.
    refit
        Fits the lag of a recording to the runs at the points of `Reruns.beside`, a batch of one each.
    """
    leading = max(fits.values(), key=_evidence)
    if leading.explains or not (leading.significance > LATE and leading.evidence > 0.0):
        return dict(fits)
    going = [
        (name, start, point)
        for name, fit in fits.items()
        if fit.evidence >= RIVAL * leading.evidence
        for start, point in enumerate(again.starts(again.x + fit.move))
    ]
    found: dict[tuple[str, int], FittedLag] = {}
    for _ in range(TURNS):
        groups, moved = [again.beside(point) for *_, point in going], []
        response, size = again.run(np.concatenate(groups)), len(again.x) + 1
        for row, (name, start, point) in enumerate(going):
            rows = range(row * size, (row + 1) * size)
            if all(response.outcomes[i].ok for i in rows):
                fit = found[name, start] = refit(name, groups[row], [response.select([i]) for i in rows])
                to = again.inside(point + fit.move)
                if not np.allclose(to, point, rtol=STILL, atol=0.0):
                    moved.append((name, start, to))
        first = max(found, key=lambda key: found[key].evidence, default=None)
        if first is not None and found[first].explains:
            moved = [one for one in moved if one[:2] == first]  # its value alone is still to be had
        going = moved
        if not going:
            break
    followed = [(name, fit) for (name, _), fit in found.items()]
    return {
        name: max([fit, *(f for other, f in followed if other == name)], key=_evidence)
        for name, fit in fits.items()
    }


def _evidence(fit: FittedLag) -> float:
    return fit.evidence


def origin(shot: Shot, recording: str) -> tuple[str, str]:
    """File with a recording's times, and the key of shot.toml that puts its clock right."""
    content = {} if shot.file is None else shot.file.content

    def file(table: str) -> str:
        section = content.get(table)
        return str(section.get("file", "shot.toml")) if isinstance(section, dict) else "shot.toml"

    if recording == FORCE:
        return (file("force"), "force.clock_offset") if "force" in content else ("shot.toml", "recorders")
    if "frames" in content and recording == FLYER:
        return file("flyer"), "flyer.frame"
    if "frames" in content:
        return file("centre_line"), "centre_line.frame"
    return "shot.toml", "pictures"
