"""Faults of a planned test: laws of shapers from pulses, the numbers of a test, the point that is wanted."""

from tests.mutants.fault import Fault

SHAPERS = ("tests/unit/prediction/test_shapers.py",)
PLANNED = ("tests/unit/prediction/test_predict.py",)
SHAPER = "kolsky/prediction/shapers.py"
PREDICT = "kolsky/prediction/predict.py"
DESIGN = "kolsky/prediction/design.py"

FAULTS = (
    Fault(
        name="the striker's rear end answers once and not twice as hard",
        file=SHAPER,
        right="(force + 2.0 * returned)",
        wrong="(force + returned)",
        tests=SHAPERS,
    ),
    Fault(
        name="the incident bar does not give way to the shaper",
        file=SHAPER,
        right=" / striker.impedance - force / incident.impedance",
        wrong=" / striker.impedance",
        tests=SHAPERS,
    ),
    Fault(
        name="a disc of rubber at small strain has mu for E",
        file=SHAPER,
        right="(stretch**-2 - stretch)\n    return loading",
        wrong="(1.0 / stretch - stretch)\n    return loading",
        tests=SHAPERS,
    ),
    Fault(
        name="a shaper unloads over twice its spring-back",
        file=SHAPER,
        right="return float((force[turn] - force[end]) / back)",
        wrong="return float(0.5 * (force[turn] - force[end]) / back)",
        tests=SHAPERS,
    ),
    Fault(
        name="the mean strain rate counts from the striker's touch",
        file=PREDICT,
        right="(strain[late] - strain[apart]) / (times[late] - times[apart])",
        wrong="(strain[late] - strain[apart]) / times[late]",
        tests=PLANNED,
    ),
    Fault(
        name="the blow of the second impact is the largest force",
        file=PREDICT,
        right="bars.force_transmission[:end].max()",
        wrong="bars.force_transmission.max()",
        tests=PLANNED,
    ),
    Fault(
        name="the static curve of the specimen without m",
        file=PREDICT,
        right="stress = -material.stiffness_factor * uniaxial_stress(law, stretch)",
        wrong="stress = -uniaxial_stress(law, stretch)",
        tests=PLANNED,
    ),
    Fault(
        name="a transducer's sensor sits at its far end",
        file=PREDICT,
        right="return depth + 0.5 * part.length",
        wrong="return depth + part.length",
        tests=PLANNED,
    ),
    Fault(
        name="a wanted number that is not known is reached",
        file=DESIGN,
        right="float(max(away)) if np.isfinite(away).all() else math.inf",
        wrong="float(np.nanmax(away))",
        tests=PLANNED,
    ),
    Fault(
        name="a specimen wider than its platens by the radius of one is not said",
        file=PREDICT,
        right="platen = 0.5 * min(",
        wrong="platen = 1.0 * min(",
        tests=PLANNED,
    ),
)
