"""Outcomes of the measurement of a surface point and of a whole frame: name, cause and cure."""

from dataclasses import dataclass
from enum import IntEnum


class Outcome(IntEnum):
    """A number that files store, with its cause and cure. Members are written ``NAME = number, cause, cure``;
    VALID has the number 0."""

    cause: str
    """Cause of the outcome, in one sentence."""
    cure: str
    """Cure for a user, in one sentence."""

    def __new__(cls, number: int, cause: str = "", cure: str = "") -> "Outcome":
        """Store the number as the value, and the two texts as attributes."""
        member = int.__new__(cls, number)
        member._value_, member.cause, member.cure = number, cause, cure
        return member

    @property
    def ok(self) -> bool:
        """True if the measured values may be used."""
        return self.value == 0


class PointOutcome(Outcome):
    """Outcome of one point in one frame.

    The integer values are those stored in `SurfaceHistory.outcome` and in files.
    """

    VALID = 0, "the point was found in both cameras", "nothing to do"
    OUT_OF_VIEW = (
        1,
        "the subset left the picture of a camera",
        "enlarge the crop, or end the window before the surface leaves it",
    )
    LOW_CONTRAST = (
        2,
        "the subset has too little grey-value gradient to be located",
        "enlarge the subset, or apply a finer speckle with more contrast",
    )
    NOT_CONVERGED = (
        3,
        "the match used up its iterations",
        "enlarge the subset, raise the frame rate, or allow a higher-order shape function",
    )
    LOW_CORRELATION = (
        4,
        "the matched subset does not look like its reference",
        "look for glare, lost speckle or a folded surface there; update the reference picture",
    )
    STEREO_MISMATCH = (
        5,
        "the rays of the two cameras do not meet",
        "check the calibration, and the match along the epipolar line",
    )
    NO_FIRST_GUESS = (
        6,
        "no neighbour or earlier frame gave a position to start from",
        "choose a seed point nearer to it, or raise the frame rate",
    )
    NO_PICTURE = (
        7,
        "the frame has no usable picture",
        "see the outcome of the frame; the other frames are not affected",
    )
    AT_END = (
        8,
        "part of the subset reaches past the end of the specimen, where its side has rolled onto a platen",
        "nothing to do; a smaller subset comes nearer to the ends",
    )
    OFF_SURFACE = (
        9,
        "the point does not lie on the smooth surface through its neighbours, or too few confirm it",
        "look for glare, a fold or an edge there; a finer grid has more neighbours",
    )


class FrameOutcome(Outcome):
    """Outcome of one frame of a picture pair; the integer values are those stored in files."""

    VALID = 0, "points were found in both cameras", "nothing to do"
    UNREADABLE = (
        1,
        "a camera's picture is missing or cannot be read",
        "export the pictures again; the other frames stand",
    )
    BLACK = (
        2,
        "a picture shows no more than its noise",
        "look at the trigger of the light and the exposure of that frame",
    )
    SATURATED = (
        3,
        "most of a picture is at the largest grey value",
        "shorten the exposure; look for a flash in that frame",
    )
    LOST = (
        4,
        "no point was found in both cameras",
        "look at the frame: a blocked view, another scene, or more motion than the search allows",
    )
    REPEATED = (
        5,
        "a camera's picture is identical to the one before",
        "export the pictures again; if it replaces a lost one, the frame times after it may be late too",
    )


@dataclass(frozen=True)
class Remark:
    """Remark on the test or its declared values, derived from the pictures."""

    name: str
    """Kind, e.g. "swapped cameras"."""
    text: str
    """One sentence with its numbers."""
    cure: str
    """Cure for a user."""
