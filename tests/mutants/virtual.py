"""Faults of the virtual laboratory: signals, draws, motion, what is wrong on purpose."""

from tests.mutants.fault import Fault

SIGNALS = ("tests/unit/virtual/test_signals.py",)
POPULATION = ("tests/unit/virtual/test_population.py",)
TRUTH = ("tests/unit/virtual/test_truth.py",)

FAULTS = (
    Fault(
        name="a low-pass whose corner is an angular frequency",
        file="kolsky/virtual/signals.py",
        right="x = 2.0 * np.pi * frequency * step",
        wrong="x = frequency * step",
        tests=SIGNALS,
    ),
    Fault(
        name="a low-pass of steps instead of lines",
        file="kolsky/virtual/signals.py",
        right="lfilter([1.0 - share, share - decay]",
        wrong="lfilter([1.0 - decay, 0.0]",
        tests=SIGNALS,
    ),
    Fault(
        name="a droop that keeps the low frequencies",
        file="kolsky/virtual/signals.py",
        right="return np.asarray(signal - low_pass(",
        wrong="return np.asarray(low_pass(",
        tests=SIGNALS,
    ),
    Fault(
        name="a code of a recorder that is twice as wide",
        file="kolsky/virtual/signals.py",
        right="return 2.0 * full_scale / 2**bits",
        wrong="return 4.0 * full_scale / 2**bits",
        tests=SIGNALS,
    ),
    Fault(
        name="codes cut off instead of rounded",
        file="kolsky/virtual/signals.py",
        right="np.rint(volts / step)",
        wrong="np.floor(volts / step)",
        tests=SIGNALS,
    ),
    Fault(
        name="a recorder with a code too many",
        file="kolsky/virtual/signals.py",
        right="2 ** (bits - 1) - 1)",
        wrong="2 ** (bits - 1))",
        tests=SIGNALS,
    ),
    Fault(
        name="a cable that delivers early",
        file="kolsky/virtual/signals.py",
        right="at = times - delay +",
        wrong="at = times + delay +",
        tests=SIGNALS,
    ),
    Fault(
        name="no jitter",
        file="kolsky/virtual/signals.py",
        right="+ jitter * rng",
        wrong="+ 0.0 * rng",
        tests=SIGNALS,
    ),
    Fault(
        name="a platen that pulls where it should push",
        file="kolsky/virtual/signals.py",
        right="return np.asarray(force + mass * acceleration)",
        wrong="return np.asarray(force - mass * acceleration)",
        tests=SIGNALS,
    ),
    Fault(
        name="a range that is spread evenly where its logarithm should be",
        file="kolsky/virtual/population.py",
        right="drawn = first * math.exp(share * math.log(second / first))",
        wrong="drawn = first + share * (second - first)",
        tests=POPULATION,
    ),
    Fault(
        name="a range without its last whole number",
        file="kolsky/virtual/population.py",
        right="endpoint=True",
        wrong="endpoint=False",
        tests=POPULATION,
    ),
    Fault(
        name="one stream for all shots",
        file="kolsky/virtual/streams.py",
        right="default_rng([seed, shot, *",
        wrong="default_rng([seed, *",
        tests=POPULATION,
    ),
    Fault(
        name="a ramp whose end forgets the slowdown",
        file="kolsky/virtual/motion.py",
        right="/ (1.0 - motion.slowdown / 3.0)",
        wrong="/ 1.0",
        tests=TRUTH,
    ),
    Fault(
        name="a slowdown that is the velocity's integral wrongly",
        file="kolsky/virtual/motion.py",
        right="after**3 / (3.0 * self.over**2)",
        wrong="after**3 / (2.0 * self.over**2)",
        tests=TRUTH,
    ),
    Fault(
        name="stress along without what is at the side",
        file="kolsky/virtual/material.py",
        right="return np.asarray(along - side * across / stretch)",
        wrong="return np.asarray(along - side)",
        tests=TRUTH,
    ),
    Fault(
        name="a flyer that turns toward an off-centre specimen",
        file="kolsky/virtual/truth.py",
        right="pitch = pitch - cumulative_trapezoid",
        wrong="pitch = pitch + cumulative_trapezoid",
        tests=TRUTH,
    ),
    Fault(
        name="a flyer of another moment of inertia",
        file="kolsky/virtual/truth.py",
        right="(3.0 * radius**2 + length**2) / 12.0",
        wrong="(6.0 * radius**2 + length**2) / 12.0",
        tests=TRUTH,
    ),
    Fault(
        name="a pitch seen at the specimen's radius",
        file="kolsky/virtual/instruments.py",
        right="surface.tilt * truth.flyer_radius",
        wrong="surface.tilt * 4.75e-3",
        tests=TRUTH,
    ),
    Fault(
        name="an outline that hides the shift of the specimen",
        file="kolsky/virtual/instruments.py",
        right="Z=Z + wrong.off_centre +",
        wrong="Z=Z +",
        tests=TRUTH,
    ),
    Fault(
        name="Yeoh's constants of a curve without their factors",
        file="kolsky/virtual/from_shot.py",
        right="np.stack([np.ones_like(x), 2.0 * x, 3.0 * x**2], axis=1)",
        wrong="np.stack([np.ones_like(x), x, x**2], axis=1)",
        tests=("tests/unit/virtual/test_from_shot.py",),
    ),
)
