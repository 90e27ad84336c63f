"""Faults of the inputs' directions, of the sensitivities, and of what is said about them."""

from tests.mutants.fault import Fault

DIRECTIONS = ("tests/unit/uncertainty/test_input_directions.py",)
SENSITIVITIES = ("tests/unit/uncertainty/test_sensitivities.py",)

FAULTS = (
    Fault(
        name="a later clock of the other sign",
        file="kolsky/uncertainty/input_changes.py",
        right="change[:n] = step * self.force_rate()",
        wrong="change[:n] = -step * self.force_rate()",
        tests=DIRECTIONS,
    ),
    Fault(
        name="a flyer's clock that moves the outline alone",
        file="kolsky/uncertainty/input_changes.py",
        right="change[:n], change[n:] = -step * self.force_rate(), -step * self.outline_rate()",
        wrong="change[:n], change[n:] = 0.0, -step * self.outline_rate()",
        tests=DIRECTIONS,
    ),
    Fault(
        name="an axis further away that makes the specimen thicker",
        file="kolsky/uncertainty/input_changes.py",
        right="change[n:] = -step\n",
        wrong="change[n:] = step\n",
        tests=DIRECTIONS,
    ),
    Fault(
        name="the whole difference of two heights",
        file="kolsky/uncertainty/input_changes.py",
        right="0.5 * (self._seen(y=y + step) - self._seen(y=y - step))",
        wrong="self._seen(y=y + step) - self._seen(y=y - step)",
        tests=DIRECTIONS,
    ),
    Fault(
        name="the whole difference of up and down",
        file="kolsky/uncertainty/input_changes.py",
        right="np.asarray(0.5 * (up - down))",
        wrong="np.asarray(up - down)",
        tests=DIRECTIONS,
    ),
    Fault(
        name="a one-sided difference of the other sign",
        file="kolsky/uncertainty/input_changes.py",
        right="np.asarray(up - centre)",
        wrong="np.asarray(centre - up)",
        tests=DIRECTIONS,
    ),
    Fault(
        name="an optimum that moves against what the prediction is short of",
        file="kolsky/uncertainty/input_changes.py",
        right="np.asarray(-self.gain @ self[key].change)",
        wrong="np.asarray(self.gain @ self[key].change)",
        tests=DIRECTIONS,
    ),
    Fault(
        name="a visible share of sizes, not of squares",
        file="kolsky/uncertainty/input_changes.py",
        right="float(np.sum(whitened(self.rest(key)) ** 2)) / whole",
        wrong="float(np.sum(np.abs(whitened(self.rest(key))))) / whole",
        tests=DIRECTIONS,
    ),
    Fault(
        name="inputs likened before the parameters have followed",
        file="kolsky/uncertainty/input_changes.py",
        right="a, b = self.objective.whitened(self.rest(one)), self.objective.whitened(self.rest(other))",
        wrong="a, b = self.objective.whitened(self[one].change), self.objective.whitened(self[other].change)",
        tests=DIRECTIONS,
    ),
    Fault(
        name="a plain amount of Poisson's ratio ten times as large",
        file="kolsky/uncertainty/inputs.py",
        right='SHARES["poisson"] * (0.5 - value)',
        wrong='SHARES["poisson"] * 10.0 * (0.5 - value)',
        tests=DIRECTIONS,
    ),
    Fault(
        name="a logarithmic derivative by the amount, not over it",
        file="kolsky/uncertainty/declarations.py",
        right="share / part.amount",
        wrong="share * part.amount",
        tests=SENSITIVITIES,
    ),
    Fault(
        name="the smallest undeclared input named",
        file="kolsky/uncertainty/declarations.py",
        right="worst = max(open_,",
        wrong="worst = min(open_,",
        tests=SENSITIVITIES,
    ),
    Fault(
        name="a share of ten times as much called invisible",
        file="kolsky/uncertainty/declarations.py",
        right="INVISIBLE = 1e-3",
        wrong="INVISIBLE = 1e-2",
        tests=SENSITIVITIES,
    ),
)
