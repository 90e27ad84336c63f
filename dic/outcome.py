"""Outcomes of the measurement of a surface point and of a whole frame: a named cause with its cure."""

from dataclasses import dataclass
from enum import IntEnum


class PointOutcome(IntEnum):
    """The end of one point in one frame.

    The integer values are those stored in `SurfaceHistory.outcome` and in files.
    """

    VALID = 0
    OUT_OF_VIEW = 1
    LOW_CONTRAST = 2
    NOT_CONVERGED = 3
    LOW_CORRELATION = 4
    STEREO_MISMATCH = 5
    NO_FIRST_GUESS = 6
    NO_PICTURE = 7
    AT_END = 8
    OFF_SURFACE = 9

    @property
    def ok(self) -> bool:
        """True when the position may be used."""
        return self is PointOutcome.VALID

    @property
    def cause(self) -> str:
        """Cause of the outcome, in one sentence."""
        return _CAUSES[self][0]

    @property
    def cure(self) -> str:
        """Cure for a user, in one sentence."""
        return _CAUSES[self][1]


_CAUSES = {
    PointOutcome.VALID: ("the point was found in both cameras", "nothing to do"),
    PointOutcome.OUT_OF_VIEW: (
        "the subset left the picture of a camera",
        "enlarge the crop, or end the window before the surface leaves it",
    ),
    PointOutcome.LOW_CONTRAST: (
        "the subset has too little grey-value gradient to be located",
        "enlarge the subset, or apply a finer speckle with more contrast",
    ),
    PointOutcome.NOT_CONVERGED: (
        "the match used up its iterations",
        "enlarge the subset, raise the frame rate, or allow a higher-order shape function",
    ),
    PointOutcome.LOW_CORRELATION: (
        "the matched subset does not look like its reference",
        "look for glare, lost speckle or a folded surface there; update the reference picture",
    ),
    PointOutcome.STEREO_MISMATCH: (
        "the rays of the two cameras do not meet",
        "check the calibration, and the match along the epipolar line",
    ),
    PointOutcome.NO_FIRST_GUESS: (
        "no neighbour or earlier frame gave a position to start from",
        "choose a seed point nearer to it, or raise the frame rate",
    ),
    PointOutcome.NO_PICTURE: (
        "the frame has no usable picture",
        "see the outcome of the frame; the other frames stand",
    ),
    PointOutcome.AT_END: (
        "part of the subset reaches past the end of the specimen, where its side has rolled onto a platen",
        "nothing to do; a smaller subset comes nearer to the ends",
    ),
    PointOutcome.OFF_SURFACE: (
        "the point does not lie on the smooth surface through its neighbours, or too few confirm it",
        "look for glare, a fold or an edge there; a finer grid has more neighbours",
    ),
}


class FrameOutcome(IntEnum):
    """The end of one frame of a picture pair; the values are those stored in files."""

    VALID = 0
    UNREADABLE = 1
    BLACK = 2
    SATURATED = 3
    LOST = 4
    REPEATED = 5

    @property
    def ok(self) -> bool:
        """True when the frame gave points."""
        return self is FrameOutcome.VALID

    @property
    def cause(self) -> str:
        """Cause of the outcome, in one sentence."""
        return _FRAME_CAUSES[self][0]

    @property
    def cure(self) -> str:
        """Cure for a user, in one sentence."""
        return _FRAME_CAUSES[self][1]


_FRAME_CAUSES = {
    FrameOutcome.VALID: ("points were found in both cameras", "nothing to do"),
    FrameOutcome.UNREADABLE: (
        "a camera's picture is missing or cannot be read",
        "export the pictures again; the other frames stand",
    ),
    FrameOutcome.BLACK: (
        "a picture shows no more than its noise",
        "look at the trigger of the light and the exposure of that frame",
    ),
    FrameOutcome.SATURATED: (
        "most of a picture is at the largest grey value",
        "shorten the exposure; look for a flash in that frame",
    ),
    FrameOutcome.LOST: (
        "no point was found in both cameras",
        "look at the frame: a blocked view, another scene, or more motion than the search allows",
    ),
    FrameOutcome.REPEATED: (
        "a camera's picture is the one before, pixel by pixel",
        "export the pictures again; if it stands in for a lost one, the frame times after it may be late too",
    ),
}


@dataclass(frozen=True)
class Remark:
    """Remark on the test or its declarations, from the pictures."""

    name: str
    """Kind, e.g. "swapped cameras"."""
    text: str
    """One sentence with its numbers."""
    cure: str
    """Cure for a user."""
