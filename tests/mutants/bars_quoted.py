"""Faults of what bar tests quote: units, plateau, first rises, drift, and the remarks about them."""

from tests.mutants.fault import Fault

UNITS = ("tests/unit/shot/test_bar_units.py",)
PLATEAUS = ("tests/unit/bars/test_plateau.py",)
RISES = ("tests/unit/bars/test_first_rise.py",)
DRIFTS = ("tests/unit/bars/test_drift.py",)
STATIONS = ("tests/unit/bars/test_waves_stations.py",)
REMARKS = ("tests/unit/bars/test_remarks_and_quoted_values.py",)
ENDS = ("tests/unit/bars/test_baseline_ends.py",)

PLATEAU = "kolsky/bars/reduction/validity.py"
RISE = "kolsky/bars/signals/arrival.py"
DRIFT = "kolsky/bars/signals/baseline.py"
ZERO = "kolsky/bars/signals/baseline.py"
STATION = "kolsky/bars/signals/stations.py"
ELASTIC_LIMIT = "kolsky/bars/signals/stations.py"
QUOTED = "kolsky/bars/reduction/summary.py"
SIGNALS = "kolsky/bars/reduction/summary.py"
SUMMARY = "kolsky/bars/reduction/summary.py"
WINDOWS = "kolsky/bars/reduction/windows.py"
PULSE_CHECKS = "kolsky/bars/reduction/windows.py"
SHOT = "kolsky/shot/bars.py"
BAR_STATIONS = "kolsky/shot/bars.py"

FAULTS = (
    Fault(
        "the shot's wanted unit overrides the file's",
        BAR_STATIONS,
        "layout = recorder.as_layout(full_scale=gauge.full_scale)",
        "layout = recorder.as_layout(full_scale=gauge.full_scale, unit=recorder.unit or wanted)",
        UNITS,
    ),
    Fault("contradicting units not said", BAR_STATIONS, "if taken == written:", "if taken:", UNITS),
    Fault(
        "any strain of a bar taken",
        ELASTIC_LIMIT,
        '"metal": 0.02, "polymer": 0.1',
        '"metal": 0.2, "polymer": 1.0',
        UNITS,
    ),
    Fault(
        "yield judged by a spike",
        ELASTIC_LIMIT,
        "moving_mean(strain, width)).max())",
        "strain).max())",
        UNITS,
    ),
    Fault("a polymer taken for metal", ELASTIC_LIMIT, "POLYMER = 20e9", "POLYMER = 2e9", UNITS),
    Fault(
        "gaps interpolated",
        "kolsky/readers/contents.py",
        "LARGEST_VARIATION = 0.05",
        "LARGEST_VARIATION = 0.5",
        UNITS,
    ),
    Fault(
        "samples of varying steps not moved",
        "kolsky/readers/recordings.py",
        "np.asarray(CubicSpline(measured, value)(time))",
        "value",
        UNITS,
    ),
    Fault("a plateau from half the level", PLATEAU, "LEVEL = 0.8", "LEVEL = 0.5", PLATEAUS),
    Fault("a plateau of any length", PLATEAU, "SHARE = 0.3", "SHARE = 0.03", PLATEAUS),
    Fault("a sloping plateau", PLATEAU, "LARGEST_CHANGE = 0.2", "LARGEST_CHANGE = 2.0", PLATEAUS),
    Fault("a ringing plateau", PLATEAU, "LARGEST_SCATTER = 0.1", "LARGEST_SCATTER = 1.0", PLATEAUS),
    Fault("a falling plateau", PLATEAU, "if not abs(self.change) <=", "if not self.change <=", PLATEAUS),
    Fault("corners of the plateau kept", PLATEAU, "INSET = 0.1", "INSET = 0.0", PLATEAUS),
    Fault(
        "the plateau beyond the largest strain",
        PLATEAU,
        "size = moving_mean(stress, width)[: last + 1]",
        "size = moving_mean(stress, width)",
        PLATEAUS,
    ),
    Fault(
        "unbalanced samples counted",
        PLATEAU,
        "np.clip(2.0 - np.abs(reduction.imbalance) / allowance, 0.0, 1.0)",
        "np.clip(9.0 - np.abs(reduction.imbalance) / allowance, 0.0, 1.0)",
        PLATEAUS,
    ),
    Fault(
        "a mean's noise without its memory",
        PLATEAU,
        "np.sqrt(alike * ((w",
        "np.sqrt(1.0 * ((w",
        PLATEAUS,
    ),
    Fault("the choice of the span exact", PLATEAU, "END_SIGMA = 0.05", "END_SIGMA = 0.005", REMARKS),
    Fault("a yield peak sets the level", PLATEAU, "np.median(size[", "np.max(size[", PLATEAUS),
    Fault(
        "a modulus while the stress falls",
        SUMMARY,
        "if begin >= int(size[: last + 1].argmax()):",
        "if begin > last:",
        REMARKS,
    ),
    Fault("first rises at a fifth", RISE, "LOW = 0.05", "LOW = 0.2", RISES),
    Fault("a first rise's memory dropped", RISE, "min(signal.memory / width, 1.0)))", "1.0 / width))", RISES),
    Fault("noise of a first rise dropped", RISE, "(noise / slope) ** 2 + step", "step", RISES),
    Fault(
        "the scatter of first rises dropped",
        PULSE_CHECKS,
        "SCATTER[0] * average, ",
        "",
        RISES,
    ),
    Fault(
        "long early pulses not looked for",
        PULSE_CHECKS,
        "before = max(min(before, rough.time - 4.0 * average), behind)",
        "pass",
        RISES,
    ),
    Fault("one way to the gauge instead of two", SIGNALS, "2.0 * first * speed", "first * speed", REMARKS),
    Fault("half of the modulus' part dropped", SIGNALS, "or 0.5 * float(", "or float(", REMARKS),
    Fault("the gauge's distance not in a way", SIGNALS, "2.0 * first_off", "0.0", REMARKS),
    Fault("gaps before the stress not said", SIGNALS, "LARGEST_TOE = 0.01", "LARGEST_TOE = 0.1", REMARKS),
    Fault("a drift that decides not said", SIGNALS, "DOMINATES = 0.5", "DOMINATES = 0.95", REMARKS),
    Fault("small second orders said", SIGNALS, "SMALL = 1e-3", "SMALL = 1e-9", REMARKS),
    Fault(
        "bends of quoted values dropped",
        QUOTED,
        "np.hypot(straight, budget.curvature[name])",
        "np.hypot(straight, 0.0)",
        REMARKS,
    ),
    Fault("means without a reason", QUOTED, "if fault is not None]", "if fault is None]", REMARKS),
    Fault("slow parts halved", DRIFT, "a = sqrt(2.0) * cosine", "a = cosine", DRIFTS),
    Fault("a weak prior of drift", DRIFT, "WEAKEST = 1.0", "WEAKEST = 0.1", DRIFTS),
    Fault("memory of the noise dropped", DRIFT, "s2 = sigma**2 * memory / n", "s2 = sigma**2 / n", DRIFTS),
    Fault(
        "modes of a bridge instead of a walk", DRIFT, "share = 2.0 / ((k - 0.5)", "share = 2.0 / (k", DRIFTS
    ),
    Fault("lost modes not made up for", DRIFT, "* share / share.sum())", "* share)", DRIFTS),
    Fault(
        "a walk that does not begin at rest",
        DRIFT,
        "np.sin(np.outer(k - 0.5",
        "np.cos(np.outer(k - 0.5",
        DRIFTS,
    ),
    Fault("no drift within the baseline", STATION, "rest.last - rest.first) / 3.0", "0.0)", STATIONS),
    Fault("a pulse in the baseline let pass", ZERO, "REST = 8.0", "REST = 80.0", DRIFTS),
    Fault("hum refused as a pulse", ZERO, "REST = 8.0", "REST = 2.0", DRIFTS),
    Fault("a spike refused as a pulse", ZERO, "beyond & (np.append(beyond[1:], True))", "beyond", DRIFTS),
    Fault("a baseline behind the pulse", WINDOWS, "if last > begin:", "if last > 2.0 * begin:", ENDS),
)
