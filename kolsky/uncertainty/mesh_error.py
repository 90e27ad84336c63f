"""The mesh's error of an answer: runs on other meshes and elements, correction, what is left, and roughness.

The change from the surrogate's mesh to the refined one, from one element to the other, and between two
graded meshes tell the error. For several shots the same changes are patterns of each shot: a faster shot
bends more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.forward import coarser_graded, graded
from kolsky.inverse.joint_problem import JointProblem, Stack
from kolsky.inverse.joint_search import Optimum, shots_slide
from kolsky.inverse.observations import Prediction, predict
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics
from kolsky.inverse.work import Launch, run_side_by_side

ORDER = 3.2
"""Order of the mesh error in the parameters, as `populations.mesh_order` fits it over both elements on seed
1, with a standard error of 0.4."""
LOW_ORDER = 2.1
"""The same on twelve tests of seed 2, with a standard error of 0.5: what it would correct more is the
standard uncertainty of the correction."""
ELEMENT_ORDER = 1.5
"""Order at which the answers of the two elements come together, fitted likewise."""
WITHOUT_ELEMENT_SHARE = 3.5
"""Standard uncertainty of the correction over its size where the other element could not be run: root mean
square of what it leaves, of three parameters in the tests that `WINDOWS` is chosen on."""
WINDOWS = 12
"""Parts of a test in each of which the mesh may err by the distance of the two elements, to either side.

Chosen on the twenty noise-free tests of `populations.mesh_windows`: over what is said, the errors of m, nu
and beta have root mean squares of 1.04, 1.04 and 1.03. With one window for the whole test they had 0.42,
0.54 and 0.96 of the distance: what a coarse mesh does early and late was added up with one sign."""


GRADED_ORDER = 2.0
"""Order of a graded mesh's error: that of bilinear elements. 2.5 and 3 leave more of the errors of m and beta
in the tests that `ELEMENT_SHARE` is chosen on."""
ELEMENT_SHARE = 0.5
"""Share of the elements' distance that counts beside what is extrapolated from graded meshes [-].

Chosen on 97 noise-free tests (`python -m populations.mesh_errors`): over what is said, the errors of m, nu
and beta, free alone or together, have root mean squares of 0.72 to 1.24, 0.90 in all."""
GRADED_ALONE_SHARE = 1.6
"""Standard uncertainty over what is extrapolated from graded meshes where the other element could not be run
[-]: root mean square in the same tests."""


@dataclass(frozen=True)
class GradedChange:
    """Changes of the predicted data vector by meshes whose elements are small where faces end."""

    coarser: FloatArray
    """Data on a coarser graded mesh minus those on the other, shape [k]."""
    ratio: float
    """Elements across the radius of the other over those of the coarser one [-], > 1."""
    graded: FloatArray | float = 0.0
    """Data on the finer graded mesh minus those on the refined one, shape [k]; 0 where it is that."""

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
    """A run at the answer that was to tell the mesh's error, and did not complete."""

    numerics: Numerics
    """Its mesh, grading and element."""
    why: str
    """How it ended, or of which shots it was, without a final stop."""
    is_graded: bool
    """Whether its mesh is one of `GradedChange`."""


@dataclass(frozen=True)
class MeshChange:
    """Changes of the predicted data vector at the answer by a coarser mesh and by the other element."""

    coarser: FloatArray
    """Data on the surrogate's mesh minus those on the refined one, shape [k]."""
    element: FloatArray | None
    """Data with the other element minus those with this one, both on the surrogate's mesh, shape [k]; None
    if it could not be run."""
    ratio: float
    """Elements across the radius of the refined mesh over those of the surrogate's [-], > 1."""
    windows: IntArray | None = None
    """Window of each entry, see `windows_of`, shape [k]; None for one window."""
    graded: GradedChange | None = None
    """By graded meshes; None where they were not run, on purpose or because one of them is among `lost`."""
    element_share: float = ELEMENT_SHARE
    """Share of the elements' distance that counts beside what is extrapolated from graded meshes [-]."""
    lost: tuple[LostRun, ...] = ()
    """Runs that did not complete: another formula stands in for what they were to tell."""

    def __post_init__(self) -> None:
        if not self.ratio > 1.0:
            raise ValueError(
                f"the refined mesh has {self.ratio:.3g} times the elements of the surrogate's across the "
                "radius, must have more than 1: the mesh error is extrapolated from both"
            )

    def shift(self, gain: FloatArray) -> FloatArray:
        """Optimum on the refined mesh minus that on the surrogate's, shape [d].

        ``gain``: linear map from what the prediction is short of to the move of the optimum, shape [d, k].
        """
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
        """Move of the optimum by a change of the data that has a sign of its own in each window, [d]."""
        windows = np.zeros(len(change), int) if self.windows is None else self.windows
        moved = np.zeros((windows.max(initial=0) + 1, len(gain)))
        np.add.at(moved, windows, (gain * change).T)
        return np.asarray(np.sqrt((moved**2).sum(axis=0)))


def windows_of(times: FloatArray) -> IntArray:
    """Which of `WINDOWS` equal parts of a test each entry is in, shape [k]."""
    if not len(times):
        return np.zeros(0, int)
    start, end = times.min(), times.max()
    share = (times - start) / max(end - start, np.finfo(float).tiny)
    return np.minimum((WINDOWS * share).astype(int), WINDOWS - 1)


def numerical_parts(
    mesh: MeshChange, gain: FloatArray, *, roughness: FloatArray | None = None
) -> Mapping[str, FloatArray]:
    """Standard uncertainties from the numerics by source, shape [d] each.

    ``mesh``, ``gain``: as of `MeshChange`. ``roughness``: standard deviation of the optimum from the
    response's roughness, shape [d]; None if it is smooth.
    """
    found = {"mesh": mesh.sigma(gain)}
    return found if roughness is None else {**found, "roughness": roughness}


@dataclass(frozen=True)
class MeshRun:
    """A run at the answer on another mesh, or with the other element."""

    numerics: Numerics
    """Its numerical choices."""
    prediction: Prediction | None
    """What the instruments would have seen; None if it did not complete."""
    ending: str
    """How it ended, a sentence without a final stop."""


BOTH_ELEMENTS = 2
"""Runs of `mesh_error_numerics` on the surrogate's mesh; what follows them is graded."""


def mesh_change(runner: Runner, fine: RefinedOptimum) -> MeshChange:
    """Run the answer on the surrogate's mesh with both elements, and on the graded mesh of the steps.

    Raises
    ------
    ValueError
        If the run with the element of the identification does not complete on the surrogate's mesh.
    """
    with runner.work.stage("check"):
        runs = mesh_error_runs(runner, fine.x, mesh_error_numerics(runner, fine))
    return change_by_runs(runner, fine, runs)


def mesh_error_numerics(runner: Runner, fine: RefinedOptimum) -> list[Numerics]:
    """Both elements on the surrogate's mesh, then the graded mesh of the steps, if there is one."""
    problem = runner.problem
    found = [problem.numerics, problem.numerics.with_other_element()]
    return found if problem.halfway == problem.refined else [*found, problem.halfway]


def mesh_error_runs(runner: Runner, point: FloatArray, numerics: Sequence[Numerics]) -> list[MeshRun]:
    """Runs at a point, those on the surrogate's mesh where it resembles the refined one."""
    launches = []
    for k, one in enumerate(numerics):
        values = runner.at(point, one.mesh) if k < BOTH_ELEMENTS else runner.problem.point(point)
        launches.append(Launch(runner.forward, values, one))
    responses = run_side_by_side(launches[::-1])[::-1]  # the longest first
    return [
        MeshRun(
            one,
            predict(response, runner.problem.observations) if response.outcomes[0].ok else None,
            response.describe(0),
        )
        for one, response in zip(numerics, responses, strict=True)
    ]


def change_by_runs(runner: Runner, fine: RefinedOptimum, runs: Sequence[MeshRun]) -> MeshChange:
    """What the runs say of the mesh."""
    numerics, x = runner.problem.numerics, fine.x
    vectors = [None if run.prediction is None else fine.objective.vectors(run.prediction)[0] for run in runs]
    coarse, element = vectors[:2]
    if coarse is None:
        across, along = numerics.mesh
        raise ValueError(
            f"the run at the answer on the surrogate's mesh of {across} x {along} elements did not complete, "
            "so that the error of the refined one cannot be estimated: refine the surrogate's mesh"
        )
    # Where the mesh is run at shifted points, in step with the refined one, the shift is taken back along the
    # slopes, which are right there; a run that is out of step with the data has other ones.
    offset = runner.offset(numerics.mesh)
    # Where a surface slides the model is the quadratic, which does not follow the jumps of single runs.
    model = fine.model(x)[0]
    found = MeshChange(
        coarser=np.nan_to_num(coarse - model) - fine.jacobian @ offset,
        element=None if element is None else np.nan_to_num(element - coarse),
        ratio=runner.problem.settings.refined_mesh[0] / numerics.mesh[0],
        windows=windows_of(fine.objective.times),
        lost=tuple(
            LostRun(run.numerics, run.ending, is_graded=k >= BOTH_ELEMENTS)
            for k, run in enumerate(runs)
            if run.prediction is None
        ),
    )
    if len(runs) == BOTH_ELEMENTS:
        return found
    if vectors[2] is None:
        return found
    ratio = runner.problem.settings.refined_mesh[0] / runs[2].numerics.mesh[0]
    return replace(found, graded=GradedChange(np.nan_to_num(vectors[2] - model), ratio))


JOINT_ELEMENT_SHARE = 1.0
"""Share of the elements' distance that is uncertain [-]: the mesh errs alike in all shots, whose noise is
small together. With half of it, as for one shot, the errors of m, nu and beta over what was said had root
mean squares of 1.26, 1.64 and 1.45 in fifty planted draws of seed 52631. With the whole of it, and what was
cured since, they have 0.94, 1.17 and 0.69 in fifty of seed 90731, which it was judged on
(docs/validation/planted_shots.md)."""


def joint_mesh_change(problem: JointProblem, found: Optimum) -> MeshChange:
    """The data at an optimum on the search's mesh, with both elements, beside those on the refined mesh.

    Raises ValueError if the run with the element of the search does not complete there.
    """
    numerics = problem.mesh
    coarse = problem.predict("check", found.x[None], numerics)[0]
    if np.isnan(coarse).any():
        raise ValueError("the run at the answer on the mesh of the search did not complete: refine --mesh")
    other = numerics.with_other_element()
    element = problem.predict("check", found.x[None], other)[0]
    lost = [] if not np.isnan(element).any() else [_joint_lost(problem, other, element, is_graded=False)]
    change = MeshChange(
        coarser=coarse - found.vector,
        element=None if np.isnan(element).any() else element - coarse,
        ratio=problem.settings.refined_mesh[0] / numerics.mesh[0],
        windows=_joint_windows(problem.stack),
        element_share=JOINT_ELEMENT_SHARE,
    )
    graded_change, more = _joint_graded(problem, found)
    return replace(change, graded=graded_change, lost=(*lost, *more))


def _joint_graded(problem: JointProblem, found: Optimum) -> tuple[GradedChange | None, list[LostRun]]:
    """The data at an optimum on two graded meshes, and which of them were lost.

    None where one is, and on purpose where a surface slides, since single runs jump, or where runs are
    corrected for Poisson's ratio, since that correction has meshes of its own.
    """
    if shots_slide(problem) or problem.mesh.compressible is not None:
        return None, []
    few, many = (mesh(problem.mesh, problem.settings.refined_mesh) for mesh in (coarser_graded, graded))
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
    """A run of which a shot's part is lost, with the shots' names: the ledger keeps no endings."""
    parts = zip(problem.runs.prepared, problem.stack.parts(vector), strict=True)
    names = [prepared.forward.shot.name for prepared, part in parts if np.isnan(part).any()]
    return LostRun(numerics, f"of {', '.join(names)}", is_graded)


def _joint_windows(stack: Stack) -> IntArray:
    """Windows of every shot; slow tests and prior knowledge, which no mesh moves, stand in the first, [k]."""
    each = [WINDOWS * i + windows_of(shot.objective.times) for i, shot in enumerate(stack.shots)]
    found = np.zeros(len(stack.data), int)
    found[: stack.ends[-1]] = np.concatenate(each)
    return found


def mesh_patterns(stack: Stack, change: MeshChange) -> FloatArray:
    """Error of the refined mesh as patterns of each shot: by Richardson and by the element, shape [n, k].

    Rows of one standard deviation: what is extrapolated may be missing altogether or be there twice; the two
    elements come together as q^-1.5 with the ratio q of the meshes.

    ``stack``: whose entries. ``change``: changes of the data vector.
    """
    rows = [change.error]
    if change.element is not None:
        rows.append(change.element / change.ratio**ELEMENT_ORDER)
    return np.array([stack.of_shot(k, row) for row in rows for k in range(len(stack.shots))])
