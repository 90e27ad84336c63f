"""One frame's matches, each point with a reference of its own, and what they are worth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.correlation import Match, PictureStack, correlate
from dic.correlation.settings import Correlation
from dic.tracking.references import References, Template, gradient, relative

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

RESIDUE = 0.0
"""Share of a match's own covariance that a change of reference leaves in the chain."""


@dataclass(frozen=True)
class Matcher:
    """Matches points of one series against their references."""

    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    settings: Correlation
    references: References
    mask: BoolArray | None

    def match(self, deformed: PictureStack, rows: IntArray, guess: FloatArray, template: Template) -> Match:
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
        """
        m = len(rows)
        result = Match(
            np.array(guess), np.zeros((m, 2, 2)), np.zeros(m), np.zeros(m, np.int64), np.zeros(m, np.int64)
        )
        for one in np.unique(template.frame):
            part = np.flatnonzero(template.frame == one)
            found = correlate(
                self.references.stacks[int(one)],
                deformed,
                self.points[rows[part]],
                guess[part],
                self.settings,
                reference_warp=template.warp[part],
                mask=self.mask,
            )
            for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
                getattr(result, name)[part] = getattr(found, name)
        return result


def shares(warp: FloatArray, reference_warp: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shares of a match's covariance that come from the template and from the picture searched in, [n] each.

    Samples that lie closer than a pixel share its noise, so that the noise of a picture weighs with the
    number of samples per pixel, 1 / det F, where the subset is flattened in it.
    """
    template = 1.0 / np.minimum(np.abs(np.linalg.det(gradient(reference_warp))), 1.0)
    searched = 1.0 / np.minimum(np.abs(np.linalg.det(gradient(warp))), 1.0)
    total = template + searched
    return template / total, searched / total


def compose(
    match_covariance: FloatArray, warp: FloatArray, template: Template
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

    Returns
    -------
    tuple
        The covariance of the places, and what a chain that takes this match as its next reference carries
        [px²], each of shape [n, 2, 2].
    """
    reference, searched = shares(warp, template.warp)
    F = relative(warp, template.warp)
    own = match_covariance * searched[:, None, None]
    left = np.where(template.root, reference, RESIDUE * searched)
    carried = F @ template.before @ np.swapaxes(F, -1, -2) + match_covariance * left[:, None, None]
    return carried + own, carried
