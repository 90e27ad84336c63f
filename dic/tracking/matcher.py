"""Matches of one frame, with a separate reference for each point, and their uncertainty.

A point's references form a chain from the material picture. The noise of an intermediate reference affects
the matches before and after it with opposite signs. To first order the chain therefore has the error of a
single match::

    Σ ∇T_A (T_A − T_B) = 0  and  Σ ∇T_B (T_B − T_C) = 0   give   Σ ∇T (T_A − T_C) ≈ 0

The deformation maps the covariance of the root's template along the chain. The covariance of the searched
picture is added. Where speckles are flattened to about a pixel, the excess residual e has an effect: the
covariance grows by ``1 + κ e``. κ is `ALONG` in the flattened direction and `ACROSS` at right angles. Both
equal `EVEN` without flattening (docs/theory/pictures.md). The match itself scales both directions by 1 + e.
"""

from collections.abc import Set
from dataclasses import dataclass, fields, replace

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray, cv2
from dic.correlation import Match, Noise, PictureStack, Templates, correlate
from dic.correlation.subsets import Correlation, apply, gradient
from dic.tracking.inputs import Picture

DEPTH = 8
"""Largest number of references stored per point: the root and the latest ones."""


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
    """The larger of two values [-], shape [...]: the largest principal stretch and the inverse of the
    smallest one."""
    largest, smallest = principal(F)
    return np.asarray(np.maximum(largest, 1.0 / np.maximum(smallest, 1e-12)))


@dataclass(frozen=True)
class Template:
    """References of points: frames of the pictures, and the points' positions in them."""

    frame: IntArray
    """Frames of the references, shape [m]."""
    warp: FloatArray
    """Total warps in the references, shape [m, 12]."""
    before: FloatArray
    """Covariance of the chain of references [px²], shape [m, 2, 2]."""
    root: BoolArray
    """True if the reference is the root of its chain, shape [m]."""
    subset: IntArray
    """Side of the subset in the material picture [px], shape [m]."""
    variance: FloatArray
    """Variance of the grey values around the points in their references [grey²], shape [m]."""
    excess: FloatArray
    """Largest excess of the residuals of the matches that led to the references [-], shape [m]."""

    def take(self, rows: IntArray) -> "Template":
        """References of the points `rows`."""
        return Template(*[getattr(self, name)[rows] for name in NAMES])

    def put(self, rows: IntArray, source: "Template") -> None:
        """Overwrite the references of points `rows` in place."""
        for name in NAMES:
            getattr(self, name)[rows] = getattr(source, name)


NAMES = tuple(field.name for field in fields(Template))
"""Fields of a template."""


class References:
    """The chains of references of n points, and the pictures that they use.

    Frames of several cameras have different numbers (`dic.tracking`).
    """

    def __init__(self, n: int, templates: Templates | None = None) -> None:
        self.templates = templates
        """Templates of the points in their current references, if they are stored."""
        self.level = np.zeros(n, dtype=np.int64)
        """Index of the current reference in the chain, shape [n]; 0 is the root."""
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
        self._variance: dict[int, FloatArray] = {}

    def add(self, frame: int, picture: Picture, stack: PictureStack) -> None:
        """Store a picture that points may use as their reference."""
        self._stacks[frame], self.pictures[frame] = stack, picture
        self._variance.pop(frame, None)
        self._forget(frame)

    def variance(self, frame: int, side: int) -> FloatArray:
        """`local_variance` of a stored picture, with one side for all calls."""
        if frame not in self._variance:
            self._variance[frame] = local_variance(self.pictures[frame], side)
        return self._variance[frame]

    def prepared(self, frames: IntArray) -> tuple[PictureStack, IntArray]:
        """A stack with the pictures of these frames, and their indices in it, shape of `frames`."""
        if self._joined is not None:
            stack, kept = self._joined
            place = np.searchsorted(kept, frames)
            if np.array_equal(kept[np.minimum(place, kept.size - 1)], frames):
                return stack, place
        available = sorted(self._stacks)  # all frames: the stack is valid until a point takes a later one
        stack = PictureStack.join([self._stacks[frame] for frame in available])
        self._joined = stack, np.array(available)
        return stack, np.searchsorted(self._joined[1], frames)

    def _forget(self, frame: int) -> None:
        """Discard the joined stack if it contains this frame."""
        if self._joined is not None and frame in self._joined[1]:
            self._joined = None

    def start(self, template: Template) -> None:
        """Set the root of all points' chains."""
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
        """References of points `rows`, or the references `back` steps earlier in their chains."""
        level = self.level[rows] - back
        return Template(*[getattr(self._chain, name)[level, rows] for name in NAMES])

    def renew(self, rows: IntArray, template: Template) -> None:
        """Give points `rows` new references. A full chain loses its oldest reference after the root."""
        full = rows[self.level[rows] == DEPTH - 1]
        self.level[full] -= 1
        self.level[rows] += 1
        self._changed(rows)
        for name in NAMES:
            chain = getattr(self._chain, name)
            chain[1:-1, full] = chain[2:, full]
            chain[self.level[rows], rows] = getattr(template, name)

    def go_back(self, rows: IntArray) -> None:
        """Return points `rows` to their previous reference."""
        self.level[rows] -= 1
        self._changed(rows)

    def tidy(self, keep: Set[int]) -> None:
        """Discard the pictures that no chain uses, except the frames `keep`."""
        self._variance = {frame: self._variance[frame] for frame in self._variance.keys() & keep}
        used = {*keep, *self._in_use()}
        for frame in [frame for frame in self._stacks if frame not in used]:
            del self._stacks[frame], self.pictures[frame]
            self._forget(frame)

    def _in_use(self) -> set[int]:
        return set(self._chain.frame[self.level >= np.arange(DEPTH)[:, None]].tolist())


ALONG = 6.0
"""κ in the direction of the smallest principal stretch, if that is one half or less."""
ACROSS = 1.0
"""κ in the direction of the largest principal stretch, in the same case."""
EVEN = 0.5
"""κ in both directions of a subset that is not flattened (`populations.dic_sigmas`, scenes "chosen")."""


def local_variance(picture: Picture, side: int) -> FloatArray:
    """Variance of the grey values in squares around each pixel [grey²], shape [rows, columns]."""
    grey = np.asarray(picture, dtype=np.float64)
    grey = grey - grey.mean()
    mean, square = (cv2.boxFilter(values, -1, (side, side)) for values in (grey, grey * grey))
    return np.asarray(np.maximum(square - mean**2, 0.0))


def excess(zncc: FloatArray, variance: FloatArray, noise: Noise, grey: float) -> FloatArray:
    """Excess of the residual's variance over that of the noise, relative to the noise [-], shape [n].

    ``zncc``: correlations, shape [n]. ``variance``: variance of the templates' grey values [grey²], shape
    [n]. ``noise``: noise of the pictures. ``grey``: mean grey value [grey].
    """
    expected = noise.floor**2 + noise.gain * grey
    if expected <= 0.0:
        return np.zeros_like(zncc)
    return np.asarray(np.maximum((1.0 - zncc) * variance / expected - 1.0, 0.0))


def enlarged(covariance: FloatArray, F: FloatArray, by: FloatArray) -> FloatArray:
    """Covariances, enlarged for the excess of the residuals [px²], shape [n, 2, 2].

    ``covariance``: covariance of matches, scaled by 1 + e [px²], shape [n, 2, 2]. ``F``: deformation
    gradients from the material picture, shape [n, 2, 2]. ``by``: excess of the residuals, shape [n].
    """
    # the principal directions in the current picture are those of F Fᵀ
    B = F @ np.swapaxes(F, -1, -2)
    largest = 0.5 * np.arctan2(2.0 * B[:, 0, 1], B[:, 0, 0] - B[:, 1, 1])
    flat = np.clip(1.0 / np.maximum(principal(F)[1], 1e-6) - 1.0, 0.0, 1.0)
    along, across = (
        np.sqrt((1.0 + (EVEN + (most - EVEN) * flat) * by) / (1.0 + by))[:, None, None]
        for most in (ALONG, ACROSS)
    )
    e = np.empty((len(largest), 2))
    e[:, 0], e[:, 1] = np.cos(largest), np.sin(largest)
    Q = along * np.eye(2) + (across - along) * e[:, :, None] * e[:, None, :]
    return np.asarray(Q @ covariance @ Q)


RESIDUE = 2.0
"""Empirical factor of the variance that a change of reference adds to the chain (verification page of the
tracking). The added share of the match's variance is this factor times the variance of the match in the
material times its samples."""


@dataclass(frozen=True)
class Matcher:
    """Matches points of one series against their references."""

    points: FloatArray
    """Positions in the material picture [px], shape [n, 2]."""
    settings: Correlation
    references: References
    mask: BoolArray | None
    noise: tuple[Noise, ...]
    """Noise of each camera."""
    camera: IntArray
    """Camera of each point, shape [n]."""

    def template(
        self,
        rows: IntArray,
        frame: IntArray,
        warp: FloatArray,
        before: FloatArray,
        subset: IntArray,
        excess: FloatArray,
    ) -> Template:
        """Frames as the references of points `rows`: frames, warps, covariances, subsets and excess there."""
        places, variance = apply(self.points[rows], warp), np.empty(len(rows))
        for one in set(frame.tolist()):
            of = frame == one
            around = self.references.variance(one, self.settings.subset)
            limit = np.array(around.shape[::-1]) - 1
            column, row = np.clip(np.round(places[of]), 0, limit).astype(np.int64).T
            variance[of] = around[row, column]
        return Template(frame, warp, before, np.zeros(len(rows), dtype=bool), subset, variance, excess)

    def excess(self, rows: IntArray, zncc: FloatArray, template: Template) -> FloatArray:
        """Residuals beyond the noise (`dic.tracking.matcher`) of points `rows`, shape [m]."""
        beyond = np.empty(len(rows))
        for camera, noise in enumerate(self.noise):
            of = self.camera[rows] == camera
            if of.any():
                grey = float(np.mean(self.references.pictures[int(template.frame[of][0])]))
                beyond[of] = excess(zncc[of], template.variance[of], noise, grey)
        return beyond

    def match(
        self,
        deformed: PictureStack,
        searched: IntArray,
        rows: IntArray,
        guess: FloatArray,
        template: Template,
        *,
        current: bool = False,
    ) -> Match:
        """Match points `rows` in the pictures of their cameras.

        ``searched``: index of each camera's picture in the stack. ``rows``: points, shape [m]. ``guess``:
        initial total warps, shape [m, 12]. ``current``: True if the references are the points' current
        references; their templates are stored.
        """
        stack, picture = self.references.prepared(template.frame)

        def of(part: IntArray | slice, subset: int) -> Match:
            return correlate(
                stack,
                deformed,
                self.points[rows[part]],
                guess[part],
                self.settings if subset == self.settings.subset else replace(self.settings, subset=subset),
                reference_picture=picture[part],
                deformed_picture=searched[self.camera[rows[part]]],
                reference_warp=template.warp[part],
                mask=self.mask,
                templates=self.references.templates if current else None,
                template_rows=rows[part],
            )

        m, subset = len(rows), template.subset
        if m and (subset == subset[0]).all():
            return of(slice(None), int(subset[0]))
        result = Match(
            np.array(guess), np.zeros((m, 2, 2)), np.zeros(m), np.zeros(m, np.int64), np.zeros(m, np.int64)
        )
        for side in sorted(set(subset.tolist())):
            part = np.flatnonzero(subset == side)
            matched = of(part, side)
            for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
                getattr(result, name)[part] = getattr(matched, name)
        return result


def shares(warp: FloatArray, reference_warp: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shares of a match's covariance due to the template and due to the searched picture, [n] each.

    Samples within one pixel share its noise. Where the subset is flattened in a picture, the noise of this
    picture is therefore weighted with the number of samples per pixel, 1 / det F.
    """
    template = 1.0 / np.minimum(np.abs(determinant(gradient(reference_warp))), 1.0)
    searched = 1.0 / np.minimum(np.abs(determinant(gradient(warp))), 1.0)
    total = template + searched
    return template / total, searched / total


def in_material(covariance: FloatArray, warp: FloatArray) -> FloatArray:
    """Covariances of positions in a picture, mapped to the material picture [px²], [n, 2, 2]."""
    back = np.linalg.inv(gradient(warp))
    return np.asarray(back @ covariance @ np.swapaxes(back, -1, -2))


def inherited_covariance(start: FloatArray, template: FloatArray, warp: FloatArray) -> FloatArray:
    """Initial covariance of a track that begins with the result of another match [px²], shape [n, 2, 2].

    The match that led to the first picture has the noise of its template and of this picture. The part of the
    picture cancels, because the track begins with a template of the same samples. It cancels completely if
    both shape functions are equal. Otherwise the one of lower order is the better estimate from the same
    samples. Its variance equals its covariance with any other estimate (Gauss and Markov). The difference of
    the two variances then remains.

    ``start``: covariance of the match [px²], shape [n, 2, 2]. ``template``: covariance due to that picture's
    noise, as the template of the track [px²], shape [n, 2, 2]. ``warp``: total warps of the match, shape [n,
    12].
    """
    reference_share, searched = (share[:, None, None] for share in shares(warp, np.zeros_like(warp)))
    size, axes = np.linalg.eigh(searched * start - template)
    apart = (axes * np.abs(size)[:, None, :]) @ np.swapaxes(axes, -1, -2)
    return np.asarray(reference_share * start + apart)


def compose(
    match_covariance: FloatArray, warp: FloatArray, template: Template, beyond: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Covariance of positions found through a chain of references (`dic.tracking.matcher`).

    ``match_covariance``: covariance of the last match only [px²], shape [n, 2, 2]. ``warp``: total warps
    found, shape [n, 12]. ``beyond``: excess of the residuals, shape [n]. Returns: the covariance of the
    positions, and that of a chain with this match as its next reference [px²], each of shape [n, 2, 2].
    """
    reference, searched = shares(warp, template.warp)
    F = relative(warp, template.warp)
    added = enlarged(match_covariance * searched[:, None, None], gradient(warp), beyond)
    reference_share = np.where(template.root, reference, 0.0)
    before = F @ template.before @ np.swapaxes(F, -1, -2) + match_covariance * reference_share[:, None, None]
    # variance of a position in the material times samples: twice the noise over the mean square gradient
    area = np.maximum(np.abs(determinant(gradient(warp))), 1e-12)
    rough = template.subset**2 * np.sqrt(np.maximum(determinant(match_covariance), 0.0)) / area
    carried = before + np.minimum(RESIDUE * rough, 1.0)[:, None, None] * added
    return before + added, carried
