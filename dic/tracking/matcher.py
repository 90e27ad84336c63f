"""One frame's matches, each point with a reference of its own, and what they are worth."""

from dataclasses import dataclass, replace

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import Match, Noise, PictureStack, correlate
from dic.correlation.settings import Correlation
from dic.correlation.warp import apply
from dic.tracking.references import References, Template, determinant, gradient, relative
from dic.tracking.residual import enlarged, excess, local_variance

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
        self, rows: IntArray, frame: int, warp: FloatArray, before: FloatArray, subset: IntArray
    ) -> Template:
        """A frame as the reference of points `rows`: warps, covariances and subsets there."""
        picture = self.references.pictures[frame]
        places = apply(self.points[rows], warp)
        return Template(
            np.full(len(rows), frame),
            warp,
            before,
            np.zeros(len(rows), dtype=bool),
            subset,
            local_variance(picture, places, self.settings.subset),
        )

    def excess(self, zncc: FloatArray, template: Template) -> FloatArray:
        """Residuals beyond the noise (`dic.tracking.residual`), shape [m]."""
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

        subsets = np.unique(template.subset).tolist()
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
