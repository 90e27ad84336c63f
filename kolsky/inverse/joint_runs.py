"""Simulations of several shots at points of their shared unknowns, each stored in a ledger.

The unknowns are parameters of the simulated test and, if requested, nodes of the curve. All shots run in one
call of the solver.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import explicit
from doe import Box
from doe.ledger import Ledger, Run
from explicit.materials import marlow_from_curve
from kolsky.base.arrays import FloatArray
from kolsky.base.files import source_hash
from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import Forward, in_surroundings
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import MOVED, design_box
from kolsky.inverse.problem import PreparedShot
from kolsky.inverse.settings import Numerics
from kolsky.inverse.valleys import VALLEY
from kolsky.inverse.work import Progress

NODE_RANGE = 1.5
"""Largest logarithm of a node's factor, up or down [-]."""


@dataclass(frozen=True)
class Unknowns:
    """Shared unknowns in one order: parameters, then the logarithms of the factors at the curve's nodes."""

    bounds: Mapping[str, tuple[float, float] | None]
    """Parameters and their bounds, None for the default ones."""
    nodes: int = 0
    """Number of free nodes of the curve. With free nodes, the stiffness factor is 1 by definition."""

    def __post_init__(self) -> None:
        if self.nodes and MOVED in self.bounds:
            raise ValueError(
                f"{MOVED} is the mean of the curve's nodes: it cannot be free together with them"
            )

    @cached_property
    def parameters(self) -> Box | None:
        """The parameters' box in their own units; None if only nodes are free."""
        return design_box(self.bounds) if self.bounds else None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns."""
        return (*self.bounds, *(f"curve_{k}" for k in range(1, self.nodes + 1)))

    @cached_property
    def box(self) -> Box:
        """All unknowns in their units."""
        p, bounds = self.parameters, dict.fromkeys(self.names, (-NODE_RANGE, NODE_RANGE))
        if p is not None:
            bounds.update(zip(p.names, zip(p.lower, p.upper, strict=True), strict=True))
        return Box.of(bounds)

    @property
    def widths(self) -> FloatArray:
        """Widths of the unknowns' ranges, in their units, shape [d]."""
        return np.array(self.box.upper) - np.array(self.box.lower)

    def relative_stiffness(self, slopes: FloatArray, x: FloatArray) -> FloatArray:
        """Derivative of the data by the logarithm of the shear modulus at a constant bulk modulus, [k].

        K is proportional to m / (1 - 2 nu). A free Poisson's ratio therefore changes by -(1 - 2 nu) / 2;
        otherwise a stiffer specimen would ring at another frequency. ``slopes``: by the unknowns, [k, d], at
        ``x``, [d].
        """
        if self.nodes:
            found = slopes[:, len(self.bounds) :].sum(axis=1)
        else:
            i = self.names.index(MOVED)
            found = slopes[:, i] * x[i]
        if VALLEY in self.names:
            j = self.names.index(VALLEY)
            found = found - slopes[:, j] * 0.5 * (1.0 - 2.0 * x[j])
        return np.asarray(found)


def node_strains(curve: MaterialCurve, nodes: int) -> FloatArray:
    """Nominal strains of the nodes, equally spaced from zero to the curve's end, shape [nodes]."""
    return np.asarray(np.linspace(0.0, float(curve.stretch[-1]) - 1.0, nodes))


def curve_bytes(curve: MaterialCurve) -> bytes:
    """The bytes of a curve. They are equal for all shots with the same curve."""
    return np.concatenate([curve.stretch, curve.stress]).tobytes()


def with_factors(curve: MaterialCurve, logs: FloatArray) -> FloatArray:
    """Stress of the slow curve times factors, with their logarithms ``logs``, [nodes], interpolated."""
    place = np.abs(node_strains(curve, len(logs)))
    return np.asarray(curve.stress * np.exp(np.interp(np.abs(curve.stretch - 1.0), place, logs)))


def smoothness(nodes: int, roughness: float) -> FloatArray:
    """Rows of the prior: second differences divided by their standard deviation, shape [nodes - 2, nodes]."""
    return np.diff(np.eye(nodes), n=2, axis=0) / roughness


ELEMENTS = ("one_point", "fbar")
"""Elements, in the order of their numbers in a ledger."""


class JointRuns:
    """Runs every shot at the same points of the shared unknowns, in one call of the solver.

    On a GPU the batches of the shots run in parallel, on a CPU one after the other. A run in the ledger is
    not repeated. ``held``: parameters at values that differ from the shots'. ``ledger``: file of the runs;
    None keeps them in memory. ``replicates``, ``seed``: number and seed of the draws of each flyer motion and
    each curve, see `vectors`. ``progress``: called with stage, runs done, runs in the stage.
    """

    def __init__(
        self,
        prepared: Sequence[PreparedShot],
        unknowns: Unknowns,
        *,
        held: Mapping[str, float],
        ledger: Path | None = None,
        replicates: int = 0,
        seed: int = 1,
        progress: Progress = lambda stage, done, total: None,
    ) -> None:
        self.prepared, self.unknowns, self.held = tuple(prepared), unknowns, dict(held)
        self.progress, self.made = progress, 0
        self.forwards = tuple(_replicated(p, replicates, seed) for p in self.prepared)
        self.known: dict[tuple[float, ...], FloatArray] = {}
        self.ledger, self.replicates, self.seed = ledger, replicates, seed
        self._file = ledger is not None and Path(ledger).exists()

    def vectors(
        self,
        stage: str,
        points: FloatArray,
        numerics: Numerics,
        *,
        motion: Sequence[int] | None = None,
        material: Sequence[int] | None = None,
    ) -> list[FloatArray]:
        """Bins and all outline points of every shot at the given points, shape [n, n_bins + Q] each.

        ``points``: unknowns in their own units, shape [n, d]. ``motion``, ``material``: index of the flyer
        path and of the curve of each point, [n]; 0 is the fitted one. The vectors have NaN at an outline
        point that a run does not reach, and everywhere in a run that did not complete.
        """
        n = len(points)
        motions = np.zeros(n, int) if motion is None else np.asarray(motion)
        curves = np.zeros(n, int) if material is None else np.asarray(material)
        kind = kind_of(numerics)
        keys = [
            [(float(k), *kind, float(motions[i]), float(curves[i]), *points[i].tolist()) for i in range(n)]
            for k in range(len(self.prepared))
        ]
        self._recall([key for row in keys for key in row])
        lost = [[i for i, key in enumerate(row) if key not in self.known] for row in keys]
        missing = {k: rows for k, rows in enumerate(lost) if rows}
        total = sum(map(len, missing.values()))
        if total:
            self.progress(stage, 0, total)
            found = in_surroundings(
                [self.prepared[k].shot for k in missing],
                [self._problem(k, points[i], numerics, motions[i], curves[i]) for k, i in missing.items()],
                partial(explicit.run_side_by_side, device=numerics.device, threads=numerics.threads),
            )
            fresh: dict[tuple[float, ...], FloatArray] = {}
            for (k, made), seen in zip(missing.items(), found, strict=True):
                rows = _response_vectors(self.prepared[k], seen)
                fresh |= {keys[k][i]: row for i, row in zip(made, rows, strict=True)}
            self.known |= fresh
            self.made += total
            self._record(fresh)
            self.progress(stage, total, total)
        return [np.stack([self.known[key] for key in row]) for row in keys]

    def _problem(
        self, k: int, points: FloatArray, numerics: Numerics, motion: np.ndarray, material: np.ndarray
    ) -> explicit.Problem:
        forward, unknowns = self.forwards[k], self.unknowns
        values = {name: points[:, i] for i, name in enumerate(unknowns.bounds)}
        if unknowns.nodes:
            if material.any():
                raise ValueError("a free curve has no separate noise: request curve 0")
            logs, material = np.unique(points[:, len(unknowns.bounds) :], axis=0, return_inverse=True)
            curve = forward.shot.curve
            laws = [marlow_from_curve(curve.stretch, with_factors(curve, row)) for row in logs]
            forward = replace(forward, laws=tuple(laws))
        given: dict[str, ArrayLike] = {**self.held, **values}
        given = given or {"stiffness_factor": np.ones(len(points))}
        return forward.problem(given, numerics, motion=motion, material=np.ravel(material))

    @cached_property
    def model_hash(self) -> bytes:
        """SHA-256 of all inputs of a run except its point and its numerics, see `kind_of`."""
        shots = [p.shot for p in self.prepared]
        said = {
            "inputs": [dict(s.inputs) for s in shots],
            "shots": [repr((s.specimen, s.interface)) for s in shots],
            "models": [repr((s.model, s.window)) for s in shots],
            "relaxation": [None if s.relaxation is None else asdict(s.relaxation) for s in shots],
            "held": self.held,
            "names": self.unknowns.names,
            "draws": [self.replicates, self.seed],
            "sources": source_hash(),
        }
        return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).digest()

    def _recall(self, keys: list[tuple[float, ...]]) -> None:
        """Load runs from the ledger into memory."""
        lost = [key for key in keys if key not in self.known]
        if self.ledger is None or not lost or not self._file:
            return
        with Ledger(self.ledger, self.model_hash) as book:
            found = zip(lost, book.find(np.array(lost)), strict=True)
            self.known |= {key: run.results for key, run in found if run is not None}

    def _record(self, fresh: Mapping[tuple[float, ...], FloatArray]) -> None:
        if self.ledger is None:
            return
        done = [bool(np.isfinite(row).any()) for row in fresh.values()]
        runs = [
            Run(completed=ok, outcome="COMPLETED" if ok else "LOST", results=row)
            for ok, row in zip(done, fresh.values(), strict=True)
        ]
        with Ledger(self.ledger, self.model_hash) as book:
            book.record(np.array(list(fresh)), runs)
        self._file = True


def kind_of(numerics: Numerics) -> tuple[float, ...]:
    """Numbers of the numerical choices that affect a result; equal only for equal choices.

    Mesh, grading and element are stored directly, the others as 48 bits of a digest, which fit a float.
    """
    rest = replace(numerics, mesh=(0, 0), grading=0.0, element="fbar", device="", threads=None)
    digest = hashlib.sha256(repr(rest).encode()).digest()[:6]
    element = float(ELEMENTS.index(numerics.element))
    return (*map(float, numerics.mesh), numerics.grading, element, float(int.from_bytes(digest, "big")))


def _replicated(prepared: PreparedShot, replicates: int, seed: int) -> Forward:
    """The shot with draws of its motion and its curve. Shots with the same curve have the same draws of it.

    The fitted motion and curve come first, then `replicates` drawn ones. If the sigma of the motion's scale
    is known, the motion scaled up by it is last.
    """
    if not replicates:
        return prepared.forward
    same = hashlib.sha256(curve_bytes(prepared.shot.curve)).digest()[:8]
    own = hashlib.sha256(repr(sorted(prepared.shot.inputs.items())).encode()).digest()[:8]
    moved = prepared.with_replicates(replicates, np.random.default_rng([seed, *own]), curves=0)
    curves = prepared.with_replicates(0, np.random.default_rng([seed, *same]), curves=replicates)
    return replace(moved, laws=curves.laws)


def _response_vectors(prepared: PreparedShot, response: explicit.Response) -> FloatArray:
    seen = prepared.observations
    found = np.full((response.n_samples, seen.n_force + len(seen.centre_line.Z)), np.nan)
    rows = np.flatnonzero(response.completed)
    if len(rows):
        prediction = predict(response.select(rows), seen)
        found[rows] = np.concatenate([prediction.force_bins, prediction.Z], axis=1)
    return found
