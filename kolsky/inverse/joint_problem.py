"""The joint least-squares problem of several shots and slow tests: prediction and weights.

Every shot has the weights of a single identification: noise, a discrepancy of each channel, the patterns of
its front face's noise (`kolsky.inverse.objective`). Three linear unknowns of a shot add one pattern each:
clock and scale of its force, and its deviation in stiffness. Each has a Gaussian prior with a standard
deviation. These unknowns are eliminated from the likelihood in closed form. A calibration shared by several
shots is one pattern over all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from doe.least_squares import Whitening, least_squares
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.inverse.gauss_newton import differences
from kolsky.inverse.joint_result import Slow
from kolsky.inverse.joint_runs import JointRuns, Unknowns, curve_bytes, smoothness
from kolsky.inverse.objective import BLOCKS, FrontNoise, Objective, Prior
from kolsky.inverse.observations import Observations
from kolsky.inverse.parameters import PARAMETERS, slides
from kolsky.inverse.path_noise import drawn_modes, noise_of
from kolsky.inverse.settings import JointSettings, Numerics
from kolsky.inverse.slow_tests import slow_measured, slow_predicted
from kolsky.inverse.valleys import from_search, search_box, to_search

GAIN, CLOCK, SCATTER = "gain", "clock", "scatter"
"""Shot-wise unknowns."""


@dataclass(frozen=True)
class ShotData:
    """One shot's data, and the patterns of its possible errors."""

    observations: Observations
    counted: BoolArray
    """Mask of the outline points used, shape [Q]."""
    front: FloatArray
    """Patterns of the front face's noise over bins and all points, shape [n, n_bins + Q]."""
    own: Mapping[str, FloatArray] = field(default_factory=dict)
    """Change of bins and all points by one standard deviation of each unknown of the shot, [n_bins + Q]."""

    @cached_property
    def objective(self) -> Objective:
        """Weights without discrepancies."""
        rows = [self.front, *(row[None] for row in self.own.values())]
        return Objective(self.observations, self.counted, FrontNoise(np.concatenate(rows)))

    @property
    def kept(self) -> BoolArray:
        """Mask of the bins and outline points used, shape [n_bins + Q]."""
        return self.objective.kept

    def taken(self, vectors: FloatArray) -> FloatArray:
        """The counted entries of vectors. An outline point that a run does not reach has zero residual."""
        seen = vectors[..., self.kept]
        lost = np.isnan(seen).all(axis=-1, keepdims=True)
        return np.asarray(np.where(np.isnan(seen) & ~lost, self.objective.data, seen))


@dataclass(frozen=True)
class Stack:
    """All data in one vector: the shots in their order, slow tests, prior knowledge."""

    shots: tuple[ShotData, ...]
    slow: FloatArray
    """Measured values of the slow tests, shape [s]."""
    slow_sigma: FloatArray
    """Their standard uncertainties, shape [s]."""
    known: int
    """Rows of prior knowledge, residuals of unit variance, at the end."""
    common: FloatArray | None = None
    """Changes of the shots' counted entries by one standard deviation of each shared error, [n, K]."""
    curve: FloatArray | None = None
    """Changes of all data by the noise of the slow curves, shots first, then slow tests, [n, K + s]."""
    slow_scatter: FloatArray | None = None
    """Changes of all data by the stiffness of each slow test's specimen, which scatters as the shots do."""

    @cached_property
    def ends(self) -> tuple[int, ...]:
        """End of each shot's entries in the vector."""
        return tuple(np.cumsum([len(one.objective.data) for one in self.shots]).tolist())

    def place(self, k: int) -> slice:
        """Entries of one shot in the vector."""
        return slice(self.ends[k - 1] if k else 0, self.ends[k])

    @cached_property
    def data(self) -> FloatArray:
        """The vector of all data, shape [k]."""
        parts = [one.objective.data for one in self.shots]
        return np.concatenate([*parts, self.slow, np.zeros(self.known)])

    def parts(self, vector: FloatArray) -> list[FloatArray]:
        """The shots' parts of a vector."""
        return np.split(vector[: self.ends[-1]], self.ends[:-1])

    def joined(self, vectors: Sequence[FloatArray], slow: FloatArray, known: FloatArray) -> FloatArray:
        """All predictions, shape [n, k], from those of each shot, shape [n, n_bins + Q] each."""
        taken = [one.taken(v) for one, v in zip(self.shots, vectors, strict=True)]
        return np.concatenate([*taken, slow, known], axis=1)

    def weighed(self, residual: FloatArray) -> list[Objective]:
        """Every shot's weights. The discrepancies are estimated from the shot's part of a residual."""
        parts = zip(self.shots, self.parts(residual), strict=True)
        return [one.objective.with_discrepancy(one.objective.data + r) for one, r in parts]

    def whitening(self, objectives: Sequence[Objective], more: FloatArray | None = None) -> Whitening:
        """The weights of the whole vector by the shots' weights and ``more`` patterns, shape [n, k]."""
        sigma = np.concatenate([*(o.own_sigma for o in objectives), self.slow_sigma, np.ones(self.known)])
        rows = [self.placed(k, objective.common) for k, objective in enumerate(objectives)]
        shared = (self.common, self.curve, self.slow_scatter, more)
        rows += [self.padded(one) for one in shared if one is not None]
        return Whitening(sigma, np.concatenate(rows))

    def placed(self, k: int, rows: FloatArray) -> FloatArray:
        """Rows over the counted entries of one shot as rows of the whole vector, shape [n, k]."""
        found = np.zeros((len(rows), len(self.data)))
        found[:, self.place(k)] = rows
        return found

    def padded(self, rows: FloatArray) -> FloatArray:
        """Rows over the first entries as rows of the whole vector, shape [n, k]."""
        return np.pad(rows, ((0, 0), (0, len(self.data) - rows.shape[1])))

    def weighting(self, residual: FloatArray) -> Whitening:
        """Weights with the discrepancies estimated from a residual."""
        return self.whitening(self.weighed(residual))

    def weighed_beside(self, residual: FloatArray, patterns: FloatArray) -> list[Objective]:
        """Every shot's weights. The discrepancies are estimated after patterns of free amplitude, shape
        [n, k], are fitted to the residual, shape [k].
        """
        whitening = self.weighting(residual)
        u, r = whitening.apply(patterns), whitening.apply(residual)
        return self.weighed(residual - np.linalg.lstsq(u.T, r, rcond=None)[0] @ patterns)

    def of_shot(self, k: int, row: FloatArray) -> FloatArray:
        """A row of all data; its entries of all other shots are zero, shape [k]."""
        return self.placed(k, row[None, self.place(k)])[0]

    def of_each(self, *rows: FloatArray) -> FloatArray:
        """Each row of all data, split into one row per shot, shape [n, k]."""
        parts = [self.of_shot(k, row) for row in rows for k in range(len(self.shots))]
        return np.reshape(parts, (-1, len(self.data)))

    @cached_property
    def blocks(self) -> list[IntArray]:
        """Labels of the entries, by length in `BLOCKS`. Entries with one label may be correlated."""
        found = []
        for length in BLOCKS:
            labels, first = [], 0
            for one in self.shots:
                own = one.objective.block // length
                labels.append(first + own)
                first += int(own.max()) + 1
            rest = len(self.slow) + self.known
            labels.append(first + np.arange(rest))
            found.append(np.concatenate(labels))
        return found


BLIND = 0.1
"""An unknown is unconstrained if its whole range changes the data by less, in standard deviations."""


def information(rows: FloatArray, widths: FloatArray) -> FloatArray:
    """Information on the unknowns, shape [d, d]. An unconstrained unknown keeps the width of its range.

    If a branch has zero strength, its time has no effect. If two branches have the same time, only the sum of
    their strengths has one. A uniform distribution of width w has the variance w^2 / 12. ``rows``: whitened
    slopes, [d, k]. ``widths``: of the ranges, [d].
    """
    blind = np.linalg.norm(rows, axis=1) * widths < BLIND
    found = rows @ rows.T + np.diag(np.where(blind, 12.0 / widths**2, 0.0))
    seen, directions = np.linalg.eigh(widths[:, None] * found * widths)
    unseen = directions[:, seen < BLIND**2] / widths[:, None]
    return np.asarray(found + 12.0 * unseen @ unseen.T if unseen.size else found)


def covariance(
    slopes: FloatArray, residual: FloatArray, whitening: Whitening, stack: Stack, widths: FloatArray
) -> FloatArray:
    """Covariance of the unknowns, with or without time correlation of the residuals, shape [d, d].

    It is the larger of Gauss-Newton's and the block "sandwich", in which residuals of one shot may be
    correlated within a time block; every variance is the largest over all block lengths. The part of the
    residual that patterns explain is in the weights and not in the blocks. ``slopes``: by the unknowns, shape
    [k, d]. ``widths``: of the ranges.
    """
    rows = whitening.apply(slopes.T)
    plain = np.linalg.inv(information(rows, widths))
    score = (plain @ rows) * whitening.apply(residual)
    best, d = plain, len(plain)
    for label in stack.blocks:
        n = int(label.max()) + 1
        sums = np.array([np.bincount(label, row, minlength=n) for row in score])
        sandwich = sums @ sums.T * n / max(n - d, 1)
        short = np.sqrt(np.maximum(np.diag(sandwich) / np.diag(best), 1.0))
        best = short[:, None] * best * short
    return np.asarray(best)


STEP = 1e-3
"""Half step of the central differences, in the unit box of the search."""
AT_REST = 0.3
"""A search has converged if its next step is shorter than this, in standard deviations."""
NEIGHBOUR = 0.3
"""Half step of the final central differences, in standard deviations."""
WIDEST = 0.05
"""Largest allowed value of that half step, as a share of the box edge."""


class JointProblem:
    """Shots and slow tests as functions of the shared unknowns; ``prior``: of the parameters, or None."""

    def __init__(self, runs: JointRuns, settings: JointSettings, slow: Slow, prior: Prior | None) -> None:
        self.runs, self.settings, self.slow, self.prior = runs, settings, slow, prior
        self.unknowns: Unknowns = runs.unknowns
        self.shots = tuple(prepared.shot for prepared in runs.prepared)
        self.first = self.shots[0]
        values, sigma = slow_measured(slow)
        shots = []
        for seen in (prepared.observations for prepared in runs.prepared):
            points = len(seen.centre_line.Z)
            shots.append(ShotData(seen, np.ones(points, bool), np.zeros((0, seen.n_force + points))))
        known = (0 if prior is None else len(prior.rows())) + max(self.unknowns.nodes - 2, 0)
        self.stack = Stack(tuple(shots), values, sigma, known)

    @cached_property
    def slides(self) -> bool:
        """True if a surface of the shots slides. Single runs then jump."""
        return slides(self.first.interface, [*self.unknowns.bounds, *self.runs.held])

    @cached_property
    def mesh(self) -> Numerics:
        """Numerics of the search."""
        return self.settings.numerics if self.slides else self.settings.numerics.for_search()

    @property
    def refined(self) -> Numerics:
        """Numerics of the answer."""
        return self.settings.numerics.with_mesh(self.settings.refined_mesh)

    def predict(self, stage: str, points: FloatArray, numerics: Numerics) -> FloatArray:
        """All predictions in one vector, shape [n, k]; NaN in the row of a point with a failed run."""
        vectors = self.runs.vectors(stage, points, numerics)
        slow = np.array([self.slow_values(x) for x in points]).reshape(len(points), -1)
        known = np.array([self.known(x) for x in points]).reshape(len(points), -1)
        return self.stack.joined(vectors, slow, known)

    def slow_values(
        self, x: FloatArray, *, curve: int = 0, held: Mapping[str, float] | None = None
    ) -> FloatArray:
        """Predicted values of the slow tests with a drawn curve, shape [s]; curve 0 is the fitted one."""
        values = {
            **self.values(x),
            **(held or {}),
            **dict(zip(self.unknowns.bounds, x.tolist(), strict=False)),
        }
        return slow_predicted(self.slow, self.runs.forwards[0].laws[curve], self.first.relaxation, values)

    def slow_parts(self) -> list[tuple[str, slice]]:
        """Label of each slow test, with its entries in the whole vector."""
        start, found = self.stack.ends[-1], []
        for one in self.slow:
            n = int(np.isfinite(one.sigma).sum())
            found.append((one.label, slice(start, start + n)))
            start += n
        return found

    def values(self, x: FloatArray) -> Mapping[str, float]:
        """Parameters by name at a point: free and held ones."""
        free = dict(zip(self.unknowns.bounds, x.tolist(), strict=False))
        return {**self.runs.held, **free}

    def known(self, x: FloatArray) -> FloatArray:
        """Residuals of the prior knowledge: declared values, and smoothness of the nodes' factors."""
        n = len(self.unknowns.bounds)
        rows = [] if self.prior is None else [self.prior.residuals(x[:n])]
        if self.unknowns.nodes:
            rows.append(smoothness(self.unknowns.nodes, self.settings.curve_roughness) @ x[n:])
        return np.concatenate(rows) if rows else np.zeros(0)

    def deviance(self, vector: FloatArray) -> float:
        """-2 ln L up to a constant; infinite for a failed run."""
        if np.isnan(vector).any():
            return float("inf")
        residual = vector - self.stack.data
        return self.stack.weighting(residual).deviance(residual)

    def count(self, x: FloatArray, numerics: Numerics) -> None:
        """Select the outline points of every shot that its run at a point reaches; ValueError if it fails."""
        vectors = self.runs.vectors("design", x[None], numerics)
        shots = []
        for one, shot, seen in zip(self.stack.shots, self.shots, vectors, strict=True):
            if np.isnan(seen).all():
                raise ValueError(
                    f"{shot.name}: the run at the start did not complete: `kolsky simulate` prints why"
                )
            shots.append(replace(one, counted=~np.isnan(seen[0, one.observations.n_force :])))
        self.stack = replace(self.stack, shots=tuple(shots))

    def vector_for(
        self, stack: Stack, x: FloatArray, numerics: Numerics, known: FloatArray | None = None
    ) -> FloatArray:
        """All predictions at a point, [k], with another stack's outline points and prior; default: none."""
        vectors = self.runs.vectors("search", x[None], numerics)
        known = np.zeros(stack.known) if known is None else known
        return stack.joined(vectors, self.slow_values(x)[None], known[None])[0]

    def search(self, starts: FloatArray, numerics: Numerics, steps: int) -> tuple[FloatArray, FloatArray]:
        """The best least-squares result from several starts, and its standard deviations, shape [d] each."""
        box = self.unknowns.box
        found = least_squares(
            lambda points: self.predict("search", from_search(box, points), numerics),
            search_box(box),
            to_search(box, np.clip(starts, box.lower, box.upper)),
            data=self.stack.data,
            weighting=self.stack.weighting,
            step=STEP,
            max_steps=steps,
            at_rest=AT_REST,
        )[0]
        x = from_search(box, found.x)
        change = from_search(box, found.x + 1e-6 * found.sigma) - x
        return x, np.where(np.isfinite(found.sigma), np.abs(change) / 1e-6, self.unknowns.widths)

    def slopes(self, x: FloatArray, sigma: FloatArray, numerics: Numerics) -> tuple[FloatArray, FloatArray]:
        """The vector at a point, [k], and its slopes by the unknowns, [k, d]; ValueError if a run fails."""
        lower, upper = np.array(self.unknowns.box.lower), np.array(self.unknowns.box.upper)
        h = np.diag(np.clip(NEIGHBOUR * sigma, 1e-4 * (upper - lower), WIDEST * (upper - lower)))
        up, down = np.minimum(x + h, upper), np.maximum(x - h, lower)
        vectors = self.predict("slopes", np.concatenate([x[None], up, down]), numerics)
        if np.isnan(vectors).any():
            raise ValueError("a run next to the optimum did not complete: give narrower bounds with --free")
        return vectors[0], differences(vectors[1:], up, down)

    def learn_noise(self, x: FloatArray, numerics: Numerics) -> None:
        """Add the front faces' noise, the clocks and the scales of the forces to the weights."""
        n = self.settings.replicates
        motion = np.arange(n + 1) if n else np.zeros(1, int)
        points = np.tile(x, (len(motion), 1))
        vectors = self.runs.vectors("noise", points, numerics, motion=motion.tolist())
        shots = []
        for one, shot, seen in zip(self.stack.shots, self.shots, vectors, strict=True):
            change = np.nan_to_num(seen[1:] - seen[0])
            front = drawn_modes(change, noise_of(one.observations)) if n else one.front
            shots.append(replace(one, front=front, own=self._own(shot.uncertainty, one, seen[0])))
        self.stack = replace(self.stack, shots=tuple(shots))
        self.stack = replace(self.stack, common=self._calibrations(), curve=self._curves(x, numerics))

    def _curves(self, x: FloatArray, numerics: Numerics) -> FloatArray | None:
        """Patterns of the slow curves' noise, one set per curve, [n, K + s]; None if none is drawn.

        Shots of one curve change together. The slow tests change with the curve of the first shot.
        """
        n = self.settings.replicates
        if not n or self.unknowns.nodes:
            return None
        numbers = list(range(n + 1))
        points = np.tile(x, (n + 1, 1))
        vectors = self.runs.vectors("noise", points, numerics, material=numbers)
        slow = np.array([self.slow_values(x, curve=k) for k in numbers]).reshape(n + 1, -1)
        whole = self.stack.joined(vectors, slow, np.zeros((n + 1, 0)))
        change = np.nan_to_num(whole[1:] - whole[0])
        noise = np.concatenate([*(one.objective.noise for one in self.stack.shots), self.stack.slow_sigma])
        groups: dict[bytes, NDArray[np.bool_]] = {}
        for k, shot in enumerate(self.shots):
            entries = groups.setdefault(curve_bytes(shot.curve), np.zeros(change.shape[1], bool))
            entries[self.stack.place(k)] = True
            if k == 0:
                entries[self.stack.ends[-1] :] = True
        return np.concatenate([drawn_modes(change * entries, noise) for entries in groups.values()])

    def _own(self, declared: Mapping[str, float], one: ShotData, vector: FloatArray) -> dict[str, FloatArray]:
        """Patterns of the clock and the gain of one shot, over bins and all points."""
        seen, found = one.observations, {}
        clock = declared.get("clock_offset", 0.0)
        if clock > 0.0:
            found[CLOCK] = np.zeros_like(vector)
            for bins, part in seen.force_parts():  # channels of one recorder
                found[CLOCK][part] = -clock * np.gradient(vector[part], bins.centres)
        if self.settings.gain_each > 0.0:
            transmitted = np.arange(len(vector)) < len(seen.bins.mean)
            found[GAIN] = np.where(transmitted, self.settings.gain_each * vector, 0.0)
        return found

    def _calibrations(self) -> FloatArray:
        """One pattern per transducer, [n, K]. Shots with the same sensitivity share its calibration error."""
        groups: dict[tuple[float, float], FloatArray] = {}
        for k, (shot, one) in enumerate(zip(self.shots, self.stack.shots, strict=True)):
            start = self.stack.place(k).start
            sigma = max(shot.uncertainty.get("sensitivity", 0.0), one.observations.force_sigma_gain)
            transducer = getattr(shot.force, "transducer", None)
            if sigma > 0.0:
                key = (float(getattr(transducer, "sensitivity", start)), sigma)
                row = groups.setdefault(key, np.zeros(self.stack.ends[-1]))
                n = len(one.observations.bins.mean)
                row[start : start + n] = sigma * one.objective.data[:n]
        return np.array(list(groups.values())).reshape(len(groups), self.stack.ends[-1])

    @property
    def declared(self) -> FloatArray:
        """The values declared by the first shot, with the curve unchanged, inside the box, shape [d]."""
        unknowns = self.unknowns
        values = [PARAMETERS[name].held(self.first) for name in unknowns.bounds] + [0.0] * unknowns.nodes
        return np.clip(np.array(values), unknowns.box.lower, unknowns.box.upper)
