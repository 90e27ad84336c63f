"""The mesh error of an answer: runs with other meshes and elements, correction, uncertainty, roughness.

The error is estimated from three changes of the prediction: from the surrogate's mesh to the refined one,
from one element to the other, and between two graded meshes. For several shots, these changes are separate
patterns of each shot, because a faster shot deforms more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.forward import coarser_graded, graded
from kolsky.inverse.joint_problem import JointProblem, Stack
from kolsky.inverse.joint_search import Optimum
from kolsky.inverse.observations import predict
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics
from kolsky.inverse.work import Launch, run_side_by_side

ORDER = 3.2
"""Order of the mesh error in the parameters. `populations.mesh_order` fits it over both elements on seed 1,
with a standard error of 0.4."""
LOW_ORDER = 2.1
"""The same order on twelve tests of seed 2, with a standard error of 0.5. The standard uncertainty of the
correction is the difference of the two corrections."""
ELEMENT_ORDER = 1.5
"""Order at which the answers of the two elements converge to each other, fitted in the same way."""
WITHOUT_ELEMENT_SHARE = 3.5
"""Standard uncertainty of the correction, as a share of its size, if the other element could not be run. It
is the root mean square of the remaining error of three parameters in the tests used for `WINDOWS`."""
WINDOWS = 12
"""Number of time windows of a test. In each window, the mesh error has the size of the distance of the two
elements, with independent sign. The number was chosen on the twenty noise-free tests of
`populations.mesh_windows`. There the errors of m, nu and beta, divided by their stated uncertainties, have
root mean squares of 1.04, 1.04 and 1.03. With one window for the whole test they had 0.42, 0.54 and 0.96 of
the distance: early and late errors of a coarse mesh were added with one sign."""


GRADED_ORDER = 2.0
"""Order of a graded mesh's error, which is that of bilinear elements. Orders of 2.5 and 3 leave larger errors
of m and beta in the tests used for `ELEMENT_SHARE`."""
ELEMENT_SHARE = 0.5
"""Share of the elements' distance that counts in addition to the extrapolation from graded meshes [-]. It was
chosen on 97 noise-free tests (`python -m populations.mesh_errors`), with m, nu and beta free separately or
together. Their errors, divided by their stated uncertainties, have root mean squares of 0.72 to 1.24, 0.90 in
all."""
GRADED_ALONE_SHARE = 1.6
"""Standard uncertainty as a share of the extrapolation from graded meshes [-], if the other element could not
be run. It is the root mean square in the same tests."""


@dataclass(frozen=True)
class GradedChange:
    """Changes of the predicted data vector by meshes with small elements at the edges of the faces."""

    coarser: FloatArray
    """Data on the coarser graded mesh minus those on the finer one, shape [k]."""
    ratio: float
    """Elements across the radius of the finer mesh divided by those of the coarser one [-], > 1."""
    graded: FloatArray | float = 0.0
    """Data on the finer graded mesh minus those on the refined one, shape [k]; 0 if both are the same."""

    @property
    def left(self) -> FloatArray:
        """Data on the finer graded mesh minus those on an infinitely fine one, by Richardson, shape [k]."""
        return self.coarser / (self.ratio**GRADED_ORDER - 1.0)

    @property
    def error(self) -> FloatArray:
        """Data on the refined mesh minus those on an infinitely fine one, shape [k]."""
        return self.left - self.graded


@dataclass(frozen=True)
class LostRun:
    """A failed run for the mesh error at the answer."""

    numerics: Numerics
    why: str
    """How it ended, or the shots it belongs to, without a full stop."""
    is_graded: bool
    """True if its mesh is one of `GradedChange`."""


@dataclass(frozen=True)
class MeshChange:
    """Changes of the predicted data vector at the answer by a coarser mesh and by the other element."""

    coarser: FloatArray
    """Data on the surrogate's mesh minus those on the refined one, shape [k]."""
    element: FloatArray | None
    """Data with the other element minus these, on the surrogate's mesh, shape [k]; None if not run."""
    ratio: float
    """Elements across the radius of the refined mesh divided by those of the surrogate's mesh [-], > 1."""
    windows: IntArray | None = None
    """Window of each entry, see `windows_of`, shape [k]; None for one window."""
    graded: GradedChange | None = None
    """Changes by graded meshes. None if they were not run by choice, or because one of them is in `lost`."""
    element_share: float = ELEMENT_SHARE
    """Share of the elements' distance that counts in addition to the extrapolation from graded meshes [-]."""
    lost: tuple[LostRun, ...] = ()
    """Failed runs. Another formula replaces them in the error."""

    def __post_init__(self) -> None:
        if not self.ratio > 1.0:
            raise ValueError(
                f"the refined mesh has {self.ratio:.3g} times the elements of the surrogate's across the "
                "radius, must have more than 1: the mesh error is extrapolated from both"
            )

    def shift(self, gain: FloatArray) -> FloatArray:
        """Optimum on the refined mesh minus that on the surrogate's, [d]; ``gain``: [d, k]."""
        return np.asarray(gain @ self.coarser)

    @property
    def error(self) -> FloatArray:
        """Data on the refined mesh minus those on an infinitely fine one, by Richardson, shape [k]."""
        return self.coarser / (self.ratio**ORDER - 1.0) if self.graded is None else self.graded.error

    def correction(self, gain: FloatArray) -> FloatArray:
        """Optimum on an infinitely fine mesh minus that on the refined one, shape [d]."""
        return np.asarray(gain @ self.error)

    def sigma(self, gain: FloatArray) -> FloatArray:
        """Standard uncertainty of the corrected optimum, shape [d]."""
        if self.graded is not None:
            left = self.in_windows(gain, self.graded.left)
            if self.element is None:
                return GRADED_ALONE_SHARE * left
            apart = self.in_windows(gain, self.element) / self.ratio**ELEMENT_ORDER
            return np.asarray(np.hypot(left, self.element_share * apart))
        correction = self.correction(gain)
        if self.element is None:
            return np.asarray(WITHOUT_ELEMENT_SHARE * np.abs(correction))
        missed = self.shift(gain) / (self.ratio**LOW_ORDER - 1.0) - correction
        apart = self.in_windows(gain, self.element) / self.ratio**ELEMENT_ORDER
        return np.asarray(np.hypot(missed, apart))

    def in_windows(self, gain: FloatArray, change: FloatArray) -> FloatArray:
        """Shift of the optimum by a change of the data with an independent sign in each window, shape [d]."""
        windows = np.zeros(len(change), int) if self.windows is None else self.windows
        moved = np.zeros((windows.max(initial=0) + 1, len(gain)))
        np.add.at(moved, windows, (gain * change).T)
        return np.asarray(np.sqrt((moved**2).sum(axis=0)))


def windows_of(times: FloatArray) -> IntArray:
    """Index of the time window of each entry, out of `WINDOWS` equal windows, shape [k]."""
    if not len(times):
        return np.zeros(0, int)
    start, end = times.min(), times.max()
    share = (times - start) / max(end - start, np.finfo(float).tiny)
    return np.minimum((WINDOWS * share).astype(int), WINDOWS - 1)


def numerical_parts(
    mesh: MeshChange, gain: FloatArray, *, roughness: FloatArray | None = None
) -> Mapping[str, FloatArray]:
    """Standard uncertainties from the numerics by source, [d] each; ``roughness``: None if it is smooth."""
    found = {"mesh": mesh.sigma(gain)}
    return found if roughness is None else {**found, "roughness": roughness}


BOTH_ELEMENTS = 2
"""Number of runs of `mesh_change` on the surrogate's mesh. Graded runs follow them."""


def mesh_change(runner: Runner, fine: RefinedOptimum) -> MeshChange:
    """Run the answer on the surrogate's mesh with both elements, and on the graded mesh of the steps.

    On the surrogate's mesh, the point is shifted to resemble the refined mesh. Raises ValueError if the run
    with the element of the identification does not complete on this mesh.
    """
    problem, x, numerics = runner.problem, fine.x, runner.problem.numerics
    meshes = [numerics, numerics.with_other_element()]
    if problem.halfway != problem.refined:
        meshes.append(problem.halfway)
    launches = [
        Launch(runner.forward, runner.at(x, one.mesh) if k < BOTH_ELEMENTS else problem.point(x), one)
        for k, one in enumerate(meshes)
    ]
    with runner.work.stage("check"):
        responses = run_side_by_side(launches[::-1])[::-1]  # the longest first
        vectors = [
            fine.objective.vectors(predict(one, problem.observations))[0] if one.outcomes[0].ok else None
            for one in responses
        ]
    coarse, element = vectors[:BOTH_ELEMENTS]
    if coarse is None:
        across, along = numerics.mesh
        raise ValueError(
            f"the run at the answer on the surrogate's mesh of {across} x {along} elements did not "
            "complete, so the error of the refined mesh cannot be estimated: refine the surrogate's mesh"
        )
    # A mesh may be run at shifted points, in phase with the refined mesh. The shift is then removed by means
    # of the slopes, which are valid at these points. A run that is out of phase with the data has other
    # slopes.
    offset, refined = runner.offset(numerics.mesh), problem.settings.refined_mesh[0]
    # If a surface slides, the model is the quadratic, which does not follow the jumps of single runs.
    model, graded_change = fine.model(x)[0], None
    if len(vectors) > BOTH_ELEMENTS and vectors[2] is not None:
        graded_change = GradedChange(np.nan_to_num(vectors[2] - model), refined / meshes[2].mesh[0])
    return MeshChange(
        coarser=np.nan_to_num(coarse - model) - fine.jacobian @ offset,
        element=None if element is None else np.nan_to_num(element - coarse),
        ratio=refined / numerics.mesh[0],
        windows=windows_of(fine.objective.times),
        graded=graded_change,
        lost=tuple(
            LostRun(one, response.describe(0), is_graded=k >= BOTH_ELEMENTS)
            for k, (one, response) in enumerate(zip(meshes, responses, strict=True))
            if not response.outcomes[0].ok
        ),
    )


JOINT_ELEMENT_SHARE = 1.0
"""Share of the elements' distance that counts as uncertainty [-]. The mesh error is similar in all shots,
while their combined noise is small. In fifty synthetic draws of seed 90731, the errors of m, nu and beta,
divided by their stated uncertainties, have root mean squares of 0.94, 1.17 and 0.69. With a share of 0.5, as
for one shot, they were 1.26, 1.64 and 1.45 in fifty draws of seed 52631
(docs/validation/planted_shots.md)."""


def joint_mesh_change(problem: JointProblem, found: Optimum) -> MeshChange:
    """Mesh change of several shots at an optimum; ValueError if a run on the search mesh fails."""
    numerics = problem.mesh
    coarse = problem.predict("check", found.x[None], numerics)[0]
    if np.isnan(coarse).any():
        raise ValueError("the run at the answer on the mesh of the search did not complete: refine --mesh")
    other = numerics.with_other_element()
    element = problem.predict("check", found.x[None], other)[0]
    failed = np.isnan(element).any()
    graded_change, lost = _joint_graded(problem, found)
    return MeshChange(
        coarser=coarse - found.vector,
        element=None if failed else element - coarse,
        ratio=problem.settings.refined_mesh[0] / numerics.mesh[0],
        windows=_joint_windows(problem.stack),
        graded=graded_change,
        element_share=JOINT_ELEMENT_SHARE,
        lost=(*([_joint_lost(problem, other, element, is_graded=False)] if failed else ()), *lost),
    )


def _joint_graded(problem: JointProblem, found: Optimum) -> tuple[GradedChange | None, list[LostRun]]:
    """The data change at an optimum between two graded meshes, and the failed runs; None if a run fails.

    It is not computed if a surface slides (single runs jump), or with a correction for Poisson's ratio.
    """
    if problem.slides or problem.mesh.compressible is not None:
        return None, []
    few = coarser_graded(problem.mesh, problem.settings.refined_mesh)
    many = graded(problem.refined, problem.settings.refined_mesh)
    coarse, same = (problem.predict("check", found.x[None], numerics)[0] for numerics in (few, many))
    lost = [
        _joint_lost(problem, numerics, vector, is_graded=True)
        for numerics, vector in ((few, coarse), (many, same))
        if np.isnan(vector).any()
    ]
    if lost:
        return None, lost
    return GradedChange(coarse - same, many.mesh[0] / few.mesh[0], same - found.vector), []


def _joint_lost(problem: JointProblem, numerics: Numerics, vector: FloatArray, *, is_graded: bool) -> LostRun:
    """A failed run with the names of its shots; the ledger does not store how a run ended."""
    parts = zip(problem.shots, problem.stack.parts(vector), strict=True)
    names = [shot.name for shot, part in parts if np.isnan(part).any()]
    return LostRun(numerics, f"of {', '.join(names)}", is_graded)


def _joint_windows(stack: Stack) -> IntArray:
    """Windows of every shot, [k]. Slow tests and priors do not depend on the mesh; their window is 0."""
    each = [WINDOWS * i + windows_of(shot.objective.times) for i, shot in enumerate(stack.shots)]
    found = np.zeros(len(stack.data), int)
    found[: stack.ends[-1]] = np.concatenate(each)
    return found


def mesh_patterns(stack: Stack, change: MeshChange) -> FloatArray:
    """Error of the refined mesh as patterns of each shot, by Richardson and by the element, shape [n, k].

    A row is one standard deviation. The uncertainty of the extrapolation equals its size. The elements'
    difference decreases as q^-1.5 with the ratio q of the meshes.
    """
    rows = [change.error]
    if change.element is not None:
        rows.append(change.element / change.ratio**ELEMENT_ORDER)
    return stack.of_each(*rows)
