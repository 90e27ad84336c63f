"""Matches of one frame, each point with a reference of its own, and their sigma: what a match leaves
unexplained beyond the pictures' noise is added to it.

A pattern flattened until its speckles are hardly wider than a pixel is sampled too coarsely: what lies beyond
half a period per pixel comes back as another pattern, which changes from frame to frame. It is not noise of
the pixels, but it shows in the correlation: a match whose only error is noise of variance σ² per picture ends
at ``2 (1 - ZNCC) var f = 2 σ²``. How much a larger residual moves the point was measured on rendered pictures
(verification page of the tracking): its covariance grows by ``1 + κ e``, e the excess of the residual over
the noise, with κ = `ALONG` in the direction that is flattened most, to half its length or less, and `ACROSS`
at right angles to it. What residual a subset has that is not flattened, from interpolation or the shape
function, moves it by less than noise would: both begin with `EVEN`, and change as the shortest side shrinks
to half. The match itself scales both directions by ``1 + e``.
"""

from dataclasses import dataclass, replace

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import Match, Noise, PictureStack, correlate
from dic.correlation.settings import Correlation
from dic.correlation.warp import apply
from dic.opencv import cv2
from dic.tracking.frames import Picture
from dic.tracking.references import References, Template, determinant, gradient, principal, relative

ALONG = 6.0
"""κ in the direction of the smallest principal stretch, where that is half or less."""
ACROSS = 1.0
"""κ in the direction of the largest one, there."""
EVEN = 0.5
"""κ in both directions of a subset that is not flattened (`benchmarks.dic_sigmas`, scenes "chosen")."""


def local_variance(picture: Picture, places: FloatArray, side: int) -> FloatArray:
    """Variance of the grey values in squares around places [grey²], shape [n].

    Parameters
    ----------
    picture
        Grey values, shape [rows, columns].
    places
        Centres (x, y) [px], shape [n, 2]; one outside the picture takes the value at its border.
    side
        Side of the squares [px].
    """
    grey = np.asarray(picture, dtype=np.float64)
    grey = grey - grey.mean()
    mean, square = (cv2.boxFilter(values, -1, (side, side)) for values in (grey, grey * grey))
    limit = np.array(grey.shape[::-1]) - 1
    column, row = np.clip(np.round(places), 0, limit).astype(np.int64).T
    return np.asarray(np.maximum(square - mean**2, 0.0)[row, column])


def excess(zncc: FloatArray, variance: FloatArray, noise: Noise, grey: float) -> FloatArray:
    """Excess of the residual's variance over that of the noise, over the latter [-], shape [n].

    Parameters
    ----------
    zncc
        Correlations, shape [n].
    variance
        Of the templates' grey values [grey²], shape [n].
    noise
        Of the pictures.
    grey
        Mean grey value [grey].
    """
    expected = noise.floor**2 + noise.gain * grey
    if expected <= 0.0:
        return np.zeros_like(zncc)
    return np.asarray(np.maximum((1.0 - zncc) * variance / expected - 1.0, 0.0))


def enlarged(covariance: FloatArray, F: FloatArray, by: FloatArray) -> FloatArray:
    """Covariances with the share that an excess residual adds [px²], shape [n, 2, 2].

    Parameters
    ----------
    covariance
        Of matches, scaled by 1 + e [px²], shape [n, 2, 2].
    F
        Deformation gradients from the material picture, shape [n, 2, 2].
    by
        Excess of the residuals, shape [n].
    """
    # the principal directions as the picture shows them are those of F Fᵀ
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
"""Share of a match's own variance that a change of reference leaves in the chain, over the variance of the
match in the material times its samples; measured (verification page of the tracking)."""


@dataclass(frozen=True)
class Matcher:
    """Matches points of one series against their references."""

    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    settings: Correlation
    references: References
    mask: BoolArray | None
    noise: Noise

    def template(
        self,
        rows: IntArray,
        frame: int,
        warp: FloatArray,
        before: FloatArray,
        subset: IntArray,
        excess: FloatArray,
    ) -> Template:
        """A frame as the reference of points `rows`: warps, covariances, subsets and excess there."""
        picture = self.references.pictures[frame]
        places = apply(self.points[rows], warp)
        return Template(
            np.full(len(rows), frame),
            warp,
            before,
            np.zeros(len(rows), dtype=bool),
            subset,
            local_variance(picture, places, self.settings.subset),
            excess,
        )

    def excess(self, zncc: FloatArray, template: Template) -> FloatArray:
        """Residuals beyond the noise (`dic.tracking.matcher`), shape [m]."""
        grey = float(np.mean(self.references.pictures[int(template.frame[0])])) if len(zncc) else 0.0
        return excess(zncc, template.variance, self.noise, grey)

    def match(
        self,
        deformed: PictureStack,
        rows: IntArray,
        guess: FloatArray,
        template: Template,
        *,
        current: bool = False,
    ) -> Match:
        """Find points `rows` in a picture.

        Parameters
        ----------
        deformed
            The picture, prepared.
        rows
            Points, shape [m].
        guess
            Total warps to start from, shape [m, 12].
        template
            Their references.
        current
            Whether those are the ones that the points have now, whose templates are kept.
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
                reference_warp=template.warp[part],
                mask=self.mask,
                templates=self.references.templates if current else None,
                template_rows=rows[part],
            )

        subsets = sorted(set(template.subset.tolist()))
        if len(subsets) == 1:
            return of(slice(None), subsets[0])
        m = len(rows)
        result = Match(
            np.array(guess), np.zeros((m, 2, 2)), np.zeros(m), np.zeros(m, np.int64), np.zeros(m, np.int64)
        )
        for subset in subsets:
            part = np.flatnonzero(template.subset == subset)
            found = of(part, subset)
            for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
                getattr(result, name)[part] = getattr(found, name)
        return result


def shares(warp: FloatArray, reference_warp: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shares of a match's covariance that come from the template and from the picture searched in, [n] each.

    Samples that lie closer than a pixel share its noise, so that the noise of a picture weighs with the
    number of samples per pixel, 1 / det F, where the subset is flattened in it.
    """
    template = 1.0 / np.minimum(np.abs(determinant(gradient(reference_warp))), 1.0)
    searched = 1.0 / np.minimum(np.abs(determinant(gradient(warp))), 1.0)
    total = template + searched
    return template / total, searched / total


def in_material(covariance: FloatArray, warp: FloatArray) -> FloatArray:
    """Covariances of places in a picture as such of the places in the material picture [px²], [n, 2, 2]."""
    back = np.linalg.inv(gradient(warp))
    return np.asarray(back @ covariance @ np.swapaxes(back, -1, -2))


def carried_from(start: FloatArray, template: FloatArray, warp: FloatArray) -> FloatArray:
    """Covariance that a track carries which begins where another match ended [px²], shape [n, 2, 2].

    The match that led to the first picture had the noise of its own template and of that picture. The track
    takes the picture's back, for it begins with a template of the same samples: wholly, if its shape function
    is the match's. If one is of higher order, the lower one is the better estimate from the same samples,
    whose errors have its own variance for their covariance with any other's (Gauss and Markov); so the
    difference of the two variances remains.

    Parameters
    ----------
    start
        Of the match [px²], shape [n, 2, 2].
    template
        What that picture's noise gives as the template of the track [px²], shape [n, 2, 2].
    warp
        Total warps of the match, shape [n, 12].
    """
    own, searched = (share[:, None, None] for share in shares(warp, np.zeros_like(warp)))
    size, axes = np.linalg.eigh(searched * start - template)
    apart = (axes * np.abs(size)[:, None, :]) @ np.swapaxes(axes, -1, -2)
    return np.asarray(own * start + apart)


def compose(
    match_covariance: FloatArray, warp: FloatArray, template: Template, beyond: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Covariance of places found through a chain of references (`dic.tracking.references`).

    Parameters
    ----------
    match_covariance
        Of the last match alone [px²], shape [n, 2, 2].
    warp
        Total warps found, shape [n, 12].
    template
        References they were matched with.
    beyond
        Excess of the residuals, shape [n].

    Returns
    -------
    tuple
        The covariance of the places, and what a chain that takes this match as its next reference carries
        [px²], each of shape [n, 2, 2].
    """
    reference, searched = shares(warp, template.warp)
    F = relative(warp, template.warp)
    own = enlarged(match_covariance * searched[:, None, None], gradient(warp), beyond)
    left = np.where(template.root, reference, 0.0)
    before = F @ template.before @ np.swapaxes(F, -1, -2) + match_covariance * left[:, None, None]
    # variance of a place times samples, in the material: twice the noise over the gradients' mean square
    area = np.maximum(np.abs(determinant(gradient(warp))), 1e-12)
    rough = template.subset**2 * np.sqrt(np.maximum(determinant(match_covariance), 0.0)) / area
    carried = before + np.minimum(RESIDUE * rough, 1.0)[:, None, None] * own
    return before + own, carried
