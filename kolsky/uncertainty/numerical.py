"""The numerics' part of an answer: the mesh's error, corrected and what is left of it, and roughness.

All of it is at fixed weights: the change of the data vector from mesh to mesh, and from element to element,
is taken at one point and carried to the parameters by the linear map that carries all other changes too. A
search of its own on another mesh would weigh the data anew, and what that moves is no error of the mesh.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.forward import Numerics

ORDER = 3.2
"""Order of the mesh error in the parameters, as `benchmarks.mesh_order` fits it over both elements on seed 1,
with a standard error of 0.4."""
LOW_ORDER = 2.1
"""The same on twelve tests of seed 2, with a standard error of 0.5: what it would correct more is the
standard uncertainty of the correction."""
ELEMENT_ORDER = 1.5
"""Order at which the answers of the two elements come together, fitted likewise."""
UNKNOWN = 3.5
"""Standard uncertainty of the correction over its size where the other element could not be run: root mean
square of what it leaves, of three parameters in the tests that `WINDOWS` is chosen on."""
WINDOWS = 12
"""Parts of a test in each of which the mesh may err by the distance of the two elements, to either side.

Chosen on the twenty noise-free tests of `benchmarks.mesh_windows`: over what is said, the errors of m, nu and
beta have root mean squares of 1.04, 1.04 and 1.03. With one window for the whole test they had 0.42, 0.54 and
0.96 of the distance: what a coarse mesh does early and late was added up with one sign."""


GRADED_ORDER = 2.0
"""Order of a graded mesh's error: that of bilinear elements. 2.5 and 3 leave more of the errors of m and beta
in the tests that `ELEMENT_SHARE` is chosen on."""
ELEMENT_SHARE = 0.5
"""Share of the elements' distance that counts beside what is extrapolated from graded meshes [-].

Chosen on 97 noise-free tests (`python -m benchmarks.mesh_errors`): over what is said, the errors of m, nu and
beta, free alone or together, have root mean squares of 0.72 to 1.24, 0.90 in all."""
ALONE = 1.6
"""Standard uncertainty over what is extrapolated from graded meshes where the other element could not be run
[-]: root mean square in the same tests."""


@dataclass(frozen=True)
class GradedChange:
    """Changes of the predicted data vector by meshes whose elements are small where faces end."""

    graded: FloatArray
    """Data on a graded mesh with as many elements as the refined one minus those on that, shape [k]."""
    coarser: FloatArray
    """Data on a coarser graded mesh minus those on the other, shape [k]."""
    ratio: float
    """Elements across the radius of the one over those of the other [-], > 1."""

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

        Parameters
        ----------
        gain
            Linear map from what the prediction is short of to the move of the optimum, shape [d, k].
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
                return ALONE * left
            apart = self.in_windows(gain, self.element) / self.ratio**ELEMENT_ORDER
            return np.asarray(np.hypot(left, self.element_share * apart))
        correction = self.correction(gain)
        if self.element is None:
            return np.asarray(UNKNOWN * np.abs(correction))
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
    """Which of `WINDOWS` equal parts of a test each entry is in, shape [k].

    Parameters
    ----------
    times
        Time of each entry [s], shape [k].
    """
    if not len(times):
        return np.zeros(0, int)
    start, end = times.min(), times.max()
    share = (times - start) / max(end - start, np.finfo(float).tiny)
    return np.minimum((WINDOWS * share).astype(int), WINDOWS - 1)


def numerical_parts(
    mesh: MeshChange, gain: FloatArray, *, roughness: FloatArray | None = None
) -> Mapping[str, FloatArray]:
    """Standard uncertainties from the numerics by source, shape [d] each.

    Parameters
    ----------
    mesh, gain
        As of `MeshChange`.
    roughness
        Standard deviation of the optimum from the response's roughness, shape [d]; None if it is smooth.
    """
    found = {"mesh": mesh.sigma(gain)}
    return found if roughness is None else {**found, "roughness": roughness}
