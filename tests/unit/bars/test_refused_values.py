"""Values that the public functions of `kolsky.bars` refuse, with the name, the value and its range."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dic.outcome import FrameOutcome
from kolsky.bars.audit import Switches, correction_of
from kolsky.bars.budget import propagate
from kolsky.bars.flyer.flight import fit_flight, symmetry_end
from kolsky.bars.flyer.front_path import front_path
from kolsky.bars.flyer.path import fit_flyer
from kolsky.bars.flyer.synchronisation import synchronise
from kolsky.bars.guides.propagation import propagation
from kolsky.bars.guides.waveguide import ElasticWaveguide, PronyModulus
from kolsky.bars.records import BarSignal, FaceWaves, History, Quantity, Signal, Windows
from kolsky.bars.reduction.inertia import compensate_mass, correct_radial_inertia
from kolsky.bars.reduction.repeated_tests import average
from kolsky.bars.reduction.separation import face_waves, separate
from kolsky.bars.reduction.stress_strain import reduce
from kolsky.bars.signals.baseline import measure_signal_zero
from kolsky.bars.signals.transducers import compensate_droop, droop_sigma, low_pass
from kolsky.base.apparatus import Bar, Specimen, Transducer
from kolsky.base.records import FlyerMotion, ForceHistory, FrontVelocity

BAR = Bar(0.02, 2.0, 210e9, 7800.0, 0.29)
FORCE_GAUGE = Transducer(sensitivity=0.01, compression_sign=1, full_scale=1.0)
GUIDE = ElasticWaveguide(BAR)
SIGNAL = Signal(0.0, 1e-6, np.zeros(100), 0.1, "1", "incident gauge")
GAUGE = BarSignal(SIGNAL, BAR, 0.9, "incident")
MOTION = FlyerMotion(1e-5 * np.arange(20.0), np.zeros(20), np.full(20, 1e-6))
FACE = FrontVelocity(1e-6 * np.arange(100.0), np.zeros(100), 0.02)
BODY: Any = SimpleNamespace(outcome=np.full(20, FrameOutcome.VALID))
FLIGHT: Any = None  # options are checked first
A = Quantity("a", 1.0, 0.1, "1", "B")
ABC = [replace(A, name=name) for name in "abc"]
X = np.linspace(0.0, 0.1, 5)
TEST = (X, X, X)
FORCE, PLATEN = History(X, X, "N"), Quantity("platen", 0.0, 0.0, "kg", "B")
WAVES = FaceWaves(X, X, X, X, dict.fromkeys(("incident", "reflected", "transmitted"), 0.1), BAR, BAR)
WINDOWS = Windows((0.0, 1e-5), (2e-5, 3e-5), (2e-5, 3e-5), "shot file")
CYLINDER = Specimen(0.01, 0.005, 1000.0)


def budget(**options):
    return propagate(lambda v: {"y": sum(v.values())}, ABC, **options)


def flown(**change):
    return symmetry_end(FLIGHT, X, **({"separation": 0.0, "over": 1e-5, "share": 0.1} | change))


def clocks(**change):
    return synchronise(MOTION, SIGNAL, **({"mass": 1.0, "rest": 0.0, "travel": 1.0} | change))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: replace(BAR, diameter=0.0), r"diameter must be in \(0, inf\) m, got 0"),
        (lambda: replace(BAR, density=np.nan), r"density must be in \(0, inf\), got nan"),
        (lambda: replace(BAR, poisson=0.5), r"poisson must be in \[0, 0.5\), got 0.5"),
        (lambda: replace(FORCE_GAUGE, sensitivity=-0.01), r"sensitivity must be in \(0, inf\) V/N"),
        (lambda: replace(FORCE_GAUGE, compression_sign=0), r"compression_sign must be \+1 or -1, got 0"),
        (lambda: replace(FORCE_GAUGE, full_scale=0.0), r"full_scale must be in \(0, inf\], got 0"),
        (lambda: replace(FORCE_GAUGE, time_constant=-1.0), r"time_constant must be in \(0, inf\], got -1"),
        (lambda: replace(SIGNAL, interval=0.0), r"interval of incident gauge must be in \(0, inf\) s, got 0"),
        (lambda: replace(SIGNAL, value=np.append(X, np.nan)), "incident gauge must be finite, got nan at 5"),
        (lambda: replace(SIGNAL, value=np.zeros((2, 3))), r"must have the shape \(6,\), got \(2, 3\)"),
        (lambda: replace(SIGNAL, sigma=-1.0), r"sigma of incident gauge must be in \[0, inf\), got -1"),
        (lambda: replace(A, value=np.inf), "a must be finite, got inf"),
        (lambda: replace(A, sigma=-0.1), r"a: sigma must be in \[0, inf\), got -0.1"),
        (lambda: replace(A, freedom=0.5), r"a: freedom must be in \[1, inf\], got 0.5"),
        (lambda: replace(A, kind="C"), "kind must be 'A' or 'B', got 'C'"),
        (lambda: Switches({"dispersoin": True}), "no correction is called 'dispersoin'; known are bridge"),
        (lambda: Switches({"mass": 1}), "switch 'mass' must be true or false, got 1"),  # type: ignore[dict-item]
        (lambda: correction_of("x", "mass", X / 0.0, applied=True, unit="N", reason="r"), "x must be finite"),
        (lambda: propagate(dict, [A, A]), "occurs twice"),
        (lambda: budget(noise={"w": 1.0}), "noise of 'w': no output is called so; there are y"),
        (lambda: budget(noise={"y": -1.0}), r"noise of y must be in \[0, inf\), got -1"),
        (lambda: budget(correlations={("a", "d"): 0.1}), "'a' and 'd': must be two of a, b, c"),
        (lambda: budget(correlations={("a", "a"): 0.1}), "must be two of"),
        (lambda: budget(correlations={("a", "b"): 1.1}), r"of a and b must be in \[-1, 1\], got 1.1"),
        (
            lambda: budget(correlations={("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}),
            "contradict each other: their matrix has the eigenvalue -0.8",
        ),
        (lambda: budget().coverage_factor("y", 95.0), r"probability must be in \(0, 1\), got 95"),
        (lambda: fit_flight(BODY, X, start=0.0), r"t must have the shape \(20,\), got \(5,\)"),
        (lambda: flown(share=0.0), r"share must be in \(0, 1\), got 0"),
        (lambda: flown(over=-1.0), r"over must be in \(0, inf\) s, got -1"),
        (lambda: flown(times_in_row=0), r"times_in_row must be in \[1, inf\), got 0"),
        (lambda: fit_flyer(MOTION, start=5e-5, covariance=np.eye(3)), r"shape \(20, 20\), got \(3, 3\)"),
        (lambda: fit_flyer(MOTION, start=5e-5, restart=np.nan), "restart must be finite, got nan"),
        (lambda: replace(MOTION, displacement=X), r"displacement must have the shape \(20,\), got \(5,\)"),
        (lambda: replace(MOTION, zero_sigma=-1.0), r"zero_sigma must be in \[0, inf\) m, got -1"),
        (lambda: replace(MOTION, shared_sigma=MOTION.sigma), r"shared_memory must be in \(0, inf\) s, got 0"),
        (lambda: replace(MOTION, shared_sigma=-MOTION.sigma), r"shared_sigma must be in \[0, inf\) m"),
        (lambda: replace(MOTION, shared_sigma=X[1:], shared_memory=1.0), r"shared_sigma must have the shape"),
        (lambda: ForceHistory(X, X, -X), r"sigma of the force must be in \[0, inf\) N"),
        (lambda: ForceHistory(X, X[1:], X), r"force must have the shape \(5,\), got \(4,\)"),
        (lambda: replace(CYLINDER, diameter=-0.01), r"diameter must be in \[0, inf\), got -0.01"),
        (lambda: clocks(mass=0.0), r"mass must be in \(0, inf\), got 0"),
        (lambda: clocks(travel=np.nan), r"travel must be in \(0, inf\), got nan"),
        (lambda: clocks(sigma_zero=-1.0), r"sigma_zero must be in \[0, inf\) N, got -1"),
        (lambda: front_path(replace(FACE, noise=0.0)), r"noise must be in \(0, inf\) m/s, got 0"),
        (lambda: front_path(replace(FACE, sigma_gain=-1.0)), r"sigma_gain must be in \[0, inf\), got -1"),
        (lambda: front_path(replace(FACE, time=np.geomspace(1e-6, 1e-3, 100))), "must be uniform"),
        (lambda: front_path(replace(FACE, velocity=np.full(100, np.nan))), "velocity must be finite"),
        (lambda: front_path(replace(FACE, velocity=np.zeros(99))), r"shape \(100,\), got \(99,\)"),
        (lambda: propagation(SIGNAL, GUIDE, np.inf), "distance must be finite, got inf"),
        (lambda: propagation(SIGNAL, GUIDE, 1.0, band=0.0), r"band must be in \(0, inf\] Hz, got 0"),
        (lambda: propagation(replace(SIGNAL, value=X), GUIDE, 1.0), r"of samples must be in \[8, inf\)"),
        (lambda: PronyModulus(1e9, (-1.0,), (1.0,)), r"moduli must be in \(0, inf\) Pa, got -1 at 0"),
        (lambda: PronyModulus(1e9, (1.0,), (0.0,)), r"times must be in \(0, inf\) s, got 0 at 0"),
        (lambda: PronyModulus(1e9, (1.0,), (1.0, 2.0)), "a modulus for each time, got 1 and 2"),
        (
            lambda: correct_radial_inertia(FORCE, History(X[1:], X[1:], "1"), FORCE, FORCE, CYLINDER),
            r"strain must have the shape \(5,\), got \(4,\)",
        ),
        (lambda: compensate_mass(FORCE, FORCE, PLATEN), r"platen must be in \(0, inf\) kg, got 0"),
        (lambda: average({"1": TEST, "2": (X[::-1], X, X)}), r"step of the strain of 2 must be in \(0"),
        (lambda: average({"1": TEST, "2": (X, X * np.nan, X)}), "stress of 2 must be finite, got nan at 0"),
        (lambda: average({"1": TEST, "2": (X, X, -X)}), r"sigma of 2 must be in \[0, inf\)"),
        (lambda: separate([GAUGE, GAUGE], GUIDE, band=np.nan), r"band must be in \(0, inf\] Hz, got nan"),
        (lambda: separate([GAUGE, GAUGE], GUIDE, end=np.nan), r"end must be in \(-inf, inf\] s, got nan"),
        (lambda: face_waves(GAUGE, GAUGE, WINDOWS, band=-1.0), r"band must be in \(0, inf\] Hz, got -1"),
        (lambda: replace(WAVES, time=X[::-1]), r"step of the time must be in \(0, inf\) s"),
        (lambda: replace(WAVES, reflected=X * np.nan), "reflected must be finite, got nan at 0"),
        (lambda: replace(WAVES, transmitted=X[1:]), r"transmitted must have the shape \(5,\), got \(4,\)"),
        (lambda: replace(WAVES, sigma={"incident": -1.0}), r"sigma of incident must be in \[0, inf\)"),
        (lambda: reduce(WAVES, CYLINDER, average=-1.0), r"average must be in \[0, inf\) s, got -1"),
        (lambda: compensate_droop(X, X[1:], 1.0, start=0.0), r"value must have the shape \(5,\), got \(4,\)"),
        (lambda: droop_sigma(X, -1.0, 1.0, start=0.0), r"sigma must be in \[0, inf\), got -1"),
        (lambda: low_pass(X, 1e-6, -5.0), r"frequency must be in \(0, inf\), got -5"),
        (lambda: low_pass(X, 0.0, 5.0), r"step must be in \(0, inf\), got 0"),
        (
            lambda: measure_signal_zero(X, X[1:], (0.0, 1.0), name="gauge"),
            r"gauge must have the shape \(5,\), got \(4,\)",
        ),
        (lambda: separate([GAUGE], GUIDE), "two gauges or more on a bar, got 1"),
        (lambda: separate([GAUGE, replace(GAUGE, bar=replace(BAR, length=1.0))], GUIDE), "different bars"),
        (lambda: separate([GAUGE, replace(GAUGE, position=-0.1)], GUIDE), r"position must be in \[0, inf\)"),
    ],
)
def test_a_value_outside_its_range_is_refused(call, message):
    with np.errstate(all="ignore"), pytest.raises(ValueError, match=message):
        call()
