"""The quasi-static test of a shot's specimen, by the shot's law, interface and Poisson's ratio."""

from collections.abc import Mapping

import numpy as np

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.inverse.parameters import PARAMETERS, any_slides, checked_value, require_effect
from kolsky.inverse.prepared_shot import prepare_shot
from kolsky.material.end_friction.slow_test import SlowNumerics
from kolsky.material.slow_compression import FIRST, SlowCompression, slow_compression
from kolsky.shot.records import Shot

POINTS = 60
"""Strains of the table."""
INERTIA = 0.01
"""Kinetic over elastic energy, or difference of the faces over their force, from which on it is said."""
PAST_DATA = 0.01
"""Share of the specimen past the curve from which on it is said."""


def slow_test_of(
    shot: Shot,
    parameters: Mapping[str, float] | None = None,
    *,
    last: float | None = None,
    error: float = 2e-3,
    mesh: tuple[int, int] = (24, 32),
    threads: int | None = None,
) -> SlowCompression:
    """Compress the specimen of a shot slowly.

    Parameters
    ----------
    shot
        A loaded shot.
    parameters
        "stiffness_factor", "friction" or "poisson" at another value than the shot's.
    last
        Last nominal compressive strain [-]; that of the window's end if left out.
    error
        Wanted relative error of the force, see `kolsky.material.slow_compression.slow_compression`.
    mesh, threads
        Elements across the radius and along the length, CPU threads.

    Raises
    ------
    ValueError
        If a parameter is not allowed or has no effect, the strain is not in (0, 1), or as
        `kolsky.material.slow_compression.slow_compression`.
    """
    given = {name: checked_value(name, value) for name, value in (parameters or {}).items()}
    interface, sliding = shot.interface, any_slides(given)
    require_effect(given, interface.faces, interface.side)
    prepared = prepare_shot(shot)

    def value(name: str) -> float:
        return given.get(name, PARAMETERS[name].held(shot))

    if last is None:
        _, position, _ = prepared.path.table(2)
        last = float(position[-1] - position[0]) / shot.specimen.length
    if not 0.0 < last < 1.0:
        raise ValueError(f"the last strain of a slow test must be in (0, 1), got {last:.4g}")
    return slow_compression(
        prepared.forward.laws[0],
        shot.specimen,
        last * np.arange(1, POINTS + 1) / POINTS,
        faces=SLIDING_LAW if sliding else interface.faces,
        side=SLIDING_LAW if sliding else interface.side,
        friction=value("friction"),
        stiffness_factor=value("stiffness_factor"),
        error=error,
        numerics=SlowNumerics(mesh=mesh, passages=FIRST, poisson=value("poisson"), threads=threads),
    )


def doubts(found: SlowCompression) -> list[str]:
    """What to know before a slow test is used."""
    said, test = [], found.test
    if test.kinetic_share > INERTIA or test.face_difference > INERTIA:
        said.append(
            f"the slow test is not at rest: its kinetic energy is {test.kinetic_share:.1%} of the elastic one"
            f" and the faces' forces differ by {test.face_difference:.1%}; ask for a smaller --error"
        )
    if test.past_data > PAST_DATA:
        said.append(
            f"{test.past_data:.0%} of the specimen's volume was strained past the quasi-static curve; from "
            "there the law goes on without a test that supports it"
        )
    return said
