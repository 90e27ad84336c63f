"""Random streams of a made shot: one for each subject, so that what is added later changes nothing else."""

from zlib import crc32

import numpy as np


def stream(seed: int, shot: int, *subject: str) -> np.random.Generator:
    """The stream of one subject of one shot, whatever else is drawn and however many shots are made.

    Parameters
    ----------
    seed
        The specification's.
    shot
        Number of the shot in its population, from 1; 0 without one.
    subject
        Words that name what is drawn, e.g. "noise", "transmitted".
    """
    return np.random.default_rng([seed, shot, *(crc32(word.encode()) for word in subject)])
