"""The inputs that are tried as causes of a misfit: one record each, one entry makes a new one."""

from math import expm1, inf, log, log1p, nan

from kolsky.diagnosis.alterations import Alteration
from kolsky.diagnosis.candidate_input import (
    BASELINE,
    DAMPING,
    DENSITY,
    DIAMETER,
    FLYER_CLOCK,
    FORCE_CLOCK,
    INTERFACE,
    KIND,
    LENGTH,
    OUTLINE_CLOCK,
    POISSON,
    SCALE,
    SENSITIVITY,
    SPREAD,
    Y_OFFSET,
    Z_OFFSET,
    CandidateInput,
    Changed,
)


def _one_more(u: float) -> float:
    return 1.0 + u


def _one_less(value: float) -> float:
    return value - 1.0


def _of_specimen(
    name: str,
    key: str,
    *,
    scan: tuple[float, ...],
    step: float,
    typical: float,
    lowest: float,
    highest: float,
) -> CandidateInput:
    """A factor on a length or the density of the specimen; u is by how much it is not 1."""
    return CandidateInput(
        key=key,
        words=f"a factor on the specimen's {name}",
        check=f"check {key}",
        scan=scan,
        step=step,
        typical=typical,
        changed=lambda u: Changed(specimen={name: 1.0 + u}),
        declared=f"specimen_{name}",
        value=_one_more,
        coordinate=_one_less,
        lowest=lowest,
        highest=highest,
        exact=1.0,
        simulated=True,
    )


_STEPS = tuple(5e-6 * n for n in range(-12, 13) if n)
"""Lags that are tried [s]."""
_SHARES = (-0.1, -0.05, -0.025, 0.025, 0.05, 0.1)
_RATIOS = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.2, 1.45, 2.0, 3.0, 5.0, 10.0)

CANDIDATES: tuple[CandidateInput, ...] = (
    CandidateInput(
        key=SENSITIVITY,
        words="a force gain",
        check="check force.sensitivity",
        scan=_RATIOS,
        step=1e-3,
        typical=0.03,
        # The force that was evaluated, times the gain, is the simulated one.
        changed=lambda u: Changed(alteration=Alteration(force_factor=u)),
        declared="sensitivity",
        value=lambda u: 1.0 / u,
        coordinate=lambda value: 1.0 / value,
        lowest=0.01,
        highest=100.0,
        exact=1.0,
        force=True,
    ),
    CandidateInput(
        key=BASELINE,
        words="a zero of the force",
        unit="N",
        check="check force.baseline: no force may act in it",
        scan=(),
        step=0.1,
        typical=0.1,
        changed=lambda u: Changed(alteration=Alteration(force_offset=u)),
        force=True,
    ),
    CandidateInput(
        key=FORCE_CLOCK,
        words="a lag of the force",
        unit="s",
        check="check force.clock_offset and frames.clock_offset",
        scan=_STEPS,
        step=1e-6,
        typical=3e-6,
        changed=lambda u: Changed(alteration=Alteration(force_lag=u)),
        onset=True,
        declared="clock_offset",
        force=True,
    ),
    CandidateInput(
        key=OUTLINE_CLOCK,
        words="a lag of the outline",
        unit="s",
        check="check the times and frame numbers of centre_line.file",
        scan=_STEPS,
        step=1e-6,
        typical=2e-6,
        changed=lambda u: Changed(alteration=Alteration(outline_lag=u)),
        outline=True,
    ),
    CandidateInput(
        key=FLYER_CLOCK,
        words="a lag of the flyer's record",
        unit="s",
        check="check the times and frame numbers of flyer.file",
        scan=_STEPS,
        step=1e-6,
        typical=2e-6,
        changed=lambda u: Changed(alteration=Alteration(force_lag=-u, outline_lag=-u)),
        onset=True,
    ),
    CandidateInput(
        key=SCALE,
        words="a factor on the flyer's displacement",
        check="check flyer.displacement: its unit, and the scale of the pictures",
        scan=_SHARES,
        step=2e-3,
        typical=0.003,
        changed=lambda u: Changed(motion=1.0 + u),
        value=_one_more,
        coordinate=_one_less,
        lowest=-0.5,
        highest=0.5,
        exact=1.0,
        simulated=True,
    ),
    CandidateInput(
        key=POISSON,
        words="another Poisson's ratio",
        check="check model.poisson, or free it",
        scan=tuple(-8.3 + 0.2 * n for n in range(31)),
        finer=0.03,
        step=0.02,
        typical=0.0005,
        changed=lambda u: Changed(values={"poisson": -0.5 * expm1(u)}),
        declared="poisson",
        value=lambda u: -0.5 * expm1(u),
        coordinate=lambda value: log1p(-2.0 * value),
        lowest=log(2e-4 * (1.0 + 1e-9)),
        highest=log(0.3),
        parameter="poisson",
        simulated=True,
    ),
    CandidateInput(
        key=DAMPING,
        words="another damping",
        unit="s",
        check="check model.damping, or free it",
        scan=(0.0, 5e-6, 1e-5, 1.5e-5, 2e-5, 2.7e-5, 3.5e-5, 5e-5, 7e-5, 1e-4, 1.5e-4),
        step=1e-6,
        typical=1e-5,
        changed=lambda u: Changed(values={"damping": u}),
        declared="damping",
        lowest=0.0,
        highest=1e-3,
        parameter="damping",
        simulated=True,
    ),
    CandidateInput(
        key=KIND,
        words="a damping proportional to mass beside it",
        unit="1/s",
        check="the material may be damped otherwise than model.damping says",
        scan=(50.0, 150.0, 400.0, 1000.0, 2500.0),
        step=20.0,
        typical=20.0,
        changed=lambda u: Changed(values={"mass_damping": u}),
        lowest=0.0,
        highest=1e4,
        parameter="mass_damping",
        simulated=True,
    ),
    _of_specimen("length", LENGTH, scan=_SHARES, step=2e-3, typical=0.01, lowest=-0.3, highest=0.3),
    _of_specimen("diameter", DIAMETER, scan=_SHARES, step=2e-3, typical=0.005, lowest=-0.3, highest=0.3),
    _of_specimen("density", DENSITY, scan=(), step=0.01, typical=0.01, lowest=-0.9, highest=9.0),
    CandidateInput(
        key=Y_OFFSET,
        words="an offset of the outline's height",
        unit="m",
        check="check centre_line.y_offset",
        scan=(-3e-4, -1e-4, 1e-4, 3e-4),
        step=1e-5,
        typical=1e-4,
        changed=lambda u: Changed(alteration=Alteration(y_offset=u)),
        declared="y_offset",
        lowest=-1e-3,
        highest=1e-3,
        outline=True,
    ),
    CandidateInput(
        key=Z_OFFSET,
        words="an offset of the outline from the axis",
        unit="m",
        check="check centre_line.Z_offset",
        scan=(),
        step=1e-5,
        typical=2e-5,
        changed=lambda u: Changed(alteration=Alteration(Z_offset=u)),
        declared="Z_offset",
        outline=True,
    ),
    CandidateInput(
        key=SPREAD,
        words="a contact that spreads over the face, or a slow force channel",
        unit="s",
        check="check the flyer's tilt, and the bandwidth of the force channel",
        scan=(2.5e-11, 1e-10, 4e-10, 1.6e-9),
        step=2.5e-11,
        allowance=8e-6,  # a frame: the flyer's onset between two of them is the fitted path's
        typical=5e-6,
        changed=lambda u: Changed(alteration=Alteration(spread=max(u, 0.0) ** 0.5)),
        value=lambda u: max(u, 0.0) ** 0.5,
        coordinate=lambda value: value**2,
        lowest=0.0,
        highest=1e-8,
        force=True,
    ),
    CandidateInput(
        key=INTERFACE,
        words="faces that slide, with a friction coefficient",
        check="check interface.faces: did the specimen stick?",
        scan=(0.1, 0.3, 1.0),
        step=0.02,
        typical=inf,
        changed=lambda u: Changed(values={"friction": u}),
        lowest=0.0,
        highest=3.0,
        exact=nan,
        simulated=True,
    ),
)
"""Every input that is tried, in the order of the tables; registry."""

WITHOUT_TRACE = (
    "The scale of the quasi-static curve leaves no residual: m times the curve is all that is seen. A curve "
    "5 % too low gives an m 5 % too high, and nothing here can tell.",
)
"""What no table of causes can show."""
