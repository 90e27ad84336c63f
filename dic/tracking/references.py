"""References of points: the picture each is compared with, and the variance that its changes add.

A point's references form a chain. Its root is the material picture (or the frame that tracking starts from);
every later reference is a frame in which the point was found, with the total warp found there. Since the
template of reference B is sampled at the very places where the match A → B ended, T_B(ξ) = g_B(W_B(ξ)), the
noise of picture B enters the match A → B and the match B → C with opposite signs::

    Σ ∇T_A (T_A − T_B) = 0  and  Σ ∇T_B (T_B − T_C) = 0   give   Σ ∇T (T_A − T_C) ≈ 0

so that to first order the chain has the error of the one match A → C. What is carried along a chain is
therefore the part of the covariance that comes from the root's template, mapped by the deformation since;
added is, of the last match, the part that comes from the picture searched in. What remains of a change of
reference is of second order: the gradients of the new template hold noise of their own. Its share in them
goes as the variance of a match times its samples, and so does what is carried along (`dic.tracking.matcher`).
"""

from dataclasses import dataclass, fields

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import PictureStack, Templates
from dic.correlation.warp import gradient
from dic.tracking.frames import Picture

DEPTH = 8
"""References kept of a point: the root and the latest ones."""


def relative(warp: FloatArray, reference_warp: FloatArray) -> FloatArray:
    """Deformation gradient since the reference, F F_ref⁻¹, shape [..., 2, 2]."""
    F = gradient(reference_warp)
    adjugate = np.empty_like(F)
    adjugate[..., 0, 0], adjugate[..., 0, 1] = F[..., 1, 1], -F[..., 0, 1]
    adjugate[..., 1, 0], adjugate[..., 1, 1] = -F[..., 1, 0], F[..., 0, 0]
    return np.asarray(gradient(warp) @ adjugate / determinant(F)[..., None, None])


def determinant(F: FloatArray) -> FloatArray:
    """Change of area of deformation gradients [-], shape [...]."""
    return np.asarray(F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0])


def principal(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Largest and smallest principal stretch of deformation gradients [-], shape [...] each."""
    total = np.sum(F * F, axis=(-2, -1))
    area = np.abs(determinant(F))
    root = np.sqrt(np.maximum(total + 2.0 * area, 0.0))
    gap = np.sqrt(np.maximum(total - 2.0 * area, 0.0))
    return np.asarray((root + gap) / 2.0), np.asarray((root - gap) / 2.0)


def stretch(F: FloatArray) -> FloatArray:
    """The larger of the largest principal stretch and the inverse of the smallest [-], shape [...]."""
    largest, smallest = principal(F)
    return np.asarray(np.maximum(largest, 1.0 / np.maximum(smallest, 1e-12)))


@dataclass(frozen=True)
class Template:
    """References of points: pictures by frame, and the points' places in them."""

    frame: IntArray
    """Frames of the references, shape [m]."""
    warp: FloatArray
    """Total warps there, shape [m, 12]."""
    before: FloatArray
    """Covariance that the chain of references carries [px²], shape [m, 2, 2]."""
    root: BoolArray
    """True if the reference is the root of its chain, shape [m]."""
    subset: IntArray
    """Side of the subset in the material picture [px], shape [m]."""
    variance: FloatArray
    """Of the grey values around the points in their references [grey²], shape [m]."""
    excess: FloatArray
    """Largest excess of the residuals of the matches that led to the references [-], shape [m]."""

    def take(self, rows: IntArray) -> "Template":
        """Those of some points."""
        return Template(*[getattr(self, name)[rows] for name in NAMES])

    def put(self, rows: IntArray, other: "Template") -> None:
        """Overwrite those of points `rows` in place."""
        for name in NAMES:
            getattr(self, name)[rows] = getattr(other, name)


NAMES = tuple(field.name for field in fields(Template))
"""Fields of a template."""


class References:
    """The chains of n points and the pictures that they use."""

    def __init__(self, n: int, templates: Templates | None = None) -> None:
        self.templates = templates
        """Templates of the points in their current references, if they are kept."""
        self.level = np.zeros(n, dtype=np.int64)
        """Place of the current reference in the chain, 0 the root, shape [n]."""
        self._chain = Template(
            np.zeros((DEPTH, n), dtype=np.int64),
            np.zeros((DEPTH, n, 12)),
            np.zeros((DEPTH, n, 2, 2)),
            np.zeros((DEPTH, n), dtype=bool),
            np.zeros((DEPTH, n), dtype=np.int64),
            np.zeros((DEPTH, n)),
            np.zeros((DEPTH, n)),
        )
        self._stacks: dict[int, PictureStack] = {}
        self._joined: tuple[PictureStack, IntArray] | None = None
        self.pictures: dict[int, Picture] = {}
        """Pictures by frame, as recorded."""

    def add(self, frame: int, picture: Picture, stack: PictureStack) -> None:
        """Keep a picture that points may take as their reference."""
        self._stacks[frame], self.pictures[frame] = stack, picture
        self._forget(frame)

    def prepared(self, frames: IntArray) -> tuple[PictureStack, IntArray]:
        """A stack that has the pictures of these frames, and where in it they are, shape of `frames`."""
        wanted = set(frames.tolist())
        if self._joined is None or not wanted <= set(self._joined[1].tolist()):
            kept = sorted(self._stacks)  # all: it serves until a point takes a later one
            self._joined = PictureStack.join([self._stacks[frame] for frame in kept]), np.array(kept)
        stack, kept_frames = self._joined
        return stack, np.searchsorted(kept_frames, frames)

    def _forget(self, frame: int) -> None:
        """Let go of the joined stack if it has this frame."""
        if self._joined is not None and frame in self._joined[1]:
            self._joined = None

    def start(self, template: Template) -> None:
        """Give all points the root of their chains."""
        self.restart()
        for name in NAMES:
            getattr(self._chain, name)[0] = getattr(template, name)

    def restart(self) -> None:
        """Return all points to the root of their chains."""
        self.level[:] = 0
        self._changed(slice(None))

    def _changed(self, rows: IntArray | slice) -> None:
        if self.templates is not None:
            self.templates.forget(rows)

    def template(self, rows: IntArray, back: int = 0) -> Template:
        """References of points `rows`, or those `back` steps earlier in their chains."""
        level = self.level[rows] - back
        return Template(*[getattr(self._chain, name)[level, rows] for name in NAMES])

    def renew(self, rows: IntArray, template: Template) -> None:
        """Give points `rows` new references; the oldest but the root is forgotten in a full chain."""
        full = rows[self.level[rows] == DEPTH - 1]
        self.level[full] -= 1
        self.level[rows] += 1
        self._changed(rows)
        for name in NAMES:
            kept = getattr(self._chain, name)
            kept[1:-1, full] = kept[2:, full]
            kept[self.level[rows], rows] = getattr(template, name)

    def go_back(self, rows: IntArray) -> None:
        """Return points `rows` to the reference before."""
        self.level[rows] -= 1
        self._changed(rows)

    def tidy(self, keep: int) -> None:
        """Let go of the pictures that no chain uses any more, other than frame `keep`."""
        used = {keep, *self._in_use()}
        for frame in [frame for frame in self._stacks if frame not in used]:
            del self._stacks[frame], self.pictures[frame]
            self._forget(frame)

    def _in_use(self) -> set[int]:
        return set(self._chain.frame[self.level >= np.arange(DEPTH)[:, None]].tolist())
