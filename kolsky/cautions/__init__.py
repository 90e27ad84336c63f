"""What a user must know before using an answer: one sentence each, with the value and what to do."""

from kolsky.cautions.collected import cautions
from kolsky.cautions.runs import PAST_CURVE, equivalent_strain, hourglass, lost_runs, past_curve, sliding

__all__ = [
    "PAST_CURVE",
    "cautions",
    "equivalent_strain",
    "hourglass",
    "lost_runs",
    "past_curve",
    "sliding",
]
