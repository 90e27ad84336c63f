"""Faults of goodness of fit, clocks and the verdicts that rest on them."""

from tests.mutants.fault import Fault

FIT = ("tests/unit/diagnosis/test_fit_quality.py",)
CLOCKS = ("tests/unit/diagnosis/test_clocks.py",)
VERDICTS = ("tests/unit/diagnosis/test_fit_verdicts.py",)
CHOICE = ("tests/unit/diagnosis/test_fit_thresholds.py",)
QUALITY = "kolsky/diagnosis/fit_quality.py"
VERDICT = "kolsky/diagnosis/fit_quality.py"
CLOCK = "kolsky/diagnosis/clocks.py"
LAG = "kolsky/diagnosis/clocks.py"
RECORDS = "kolsky/inverse/result.py"

FAULTS = (
    Fault(
        "free parameters absorb nothing",
        QUALITY,
        "change - (change @ gain.T)",
        "change - 0.0 * (change @ gain.T)",
        FIT,
    ),
    Fault(
        "shares of information from weights not squared",
        QUALITY,
        "parts = gain * spread",
        "parts = np.abs(spread)",
        FIT,
    ),
    Fault("Ljung and Box without its factor", QUALITY, "n * (n + 2.0) / (n - 1.0) * r**2", "n * r**2", FIT),
    Fault("correlation over the number of pairs", QUALITY, "/ (n * square)", "/ ((n - 1) * square)", FIT),
    Fault("neighbours across frames", QUALITY, "== 0\n    placed", ">= 0\n    placed", FIT),
    Fault(
        "noise of a block's mean as of one value",
        QUALITY,
        "/ np.bincount(block) ** 2",
        "/ np.bincount(block)",
        FIT,
    ),
    Fault("half as many blocks", QUALITY, "BLOCKS = 8", "BLOCKS = 4", FIT),
    Fault("the discrepancy not squared", QUALITY, "float(tau**2 / (", "float(tau / (", FIT),
    Fault(
        "limits though the flyer's noise is unknown",
        QUALITY,
        "limit=LIMITS[channel] if FLYER in changes else inf,\n                slow",
        "limit=LIMITS[channel],\n                slow",
        FIT,
    ),
    Fault(
        "a mesh error of first order in the data",
        "kolsky/diagnosis/fit_quality.py",
        "ORDER = 2.0",
        "ORDER = 1.0",
        FIT,
    ),
    Fault(
        "declared inputs averaged, not added",
        "kolsky/uncertainty/input_changes.py",
        "np.sqrt(len(rows)) * np.array(rows)",
        "np.array(rows)",
        FIT,
    ),
    Fault("either limit is enough", RECORDS, "<= self.limit and self", "<= self.limit or self", FIT),
    Fault(
        "predicted parts add up linearly",
        RECORDS,
        "sum(part**2 for part in self.predicted.values()) ** 0.5",
        "sum(self.predicted.values())",
        VERDICTS,
    ),
    Fault(
        "one channel's say from its own share",
        VERDICT,
        "1.0 - channel.weight.get(e.name, 0.5) < ALONE",
        "channel.weight.get(e.name, 0.5) < ALONE",
        VERDICTS,
    ),
    Fault(
        "a channel checks itself",
        VERDICT,
        "routes.get(ROUTES[OTHER[channel]], inf)",
        "routes.get(ROUTES[channel], inf)",
        VERDICTS,
    ),
    Fault(
        "a channel at an edge checks a value",
        VERDICT,
        "<= CHECKS * joint and not route_at_edge(result, name)",
        "<= CHECKS * joint",
        VERDICTS,
    ),
    Fault(
        "a channel three times as uncertain checks a value",
        "kolsky/diagnosis/fit_quality.py",
        "CHECKS = 2.0",
        "CHECKS = 3.0",
        VERDICTS,
    ),
    Fault(
        "a share of a fifth has no say",
        "kolsky/diagnosis/fit_quality.py",
        "ALONE = 0.1",
        "ALONE = 0.2",
        VERDICTS,
    ),
    Fault(
        "contradiction only beyond six sigma",
        "kolsky/diagnosis/fit_quality.py",
        "CONTRADICTION = 4.0",
        "CONTRADICTION = 6.0",
        VERDICTS,
    ),
    Fault(
        "clocks late beyond one sigma",
        "kolsky/diagnosis/fit_quality.py",
        "LATE = 3.0",
        "LATE = 1.0",
        VERDICTS,
    ),
    Fault(
        "a negative difference contradicts nothing",
        VERDICT,
        "return abs(found.values[name])",
        "return found.values[name]",
        VERDICTS,
    ),
    Fault(
        "graver verdicts are overruled",
        VERDICT,
        "if e.outcome not in WITHHELD:",
        "if e.outcome is Verdict.FAILED:",
        VERDICTS,
    ),
    Fault(
        "an excess is compared with a misfit, its square",
        VERDICT,
        "max(f.excess, f.slow_excess) ** 2 <= UNEXPLAINED",
        "max(f.excess, f.slow_excess) <= UNEXPLAINED",
        VERDICTS,
    ),
    Fault(
        "a slow excess is no misfit",
        VERDICT,
        "max(f.excess, f.slow_excess) ** 2 <= UNEXPLAINED",
        "f.excess**2 <= UNEXPLAINED",
        VERDICTS,
    ),
    Fault(
        "an interval may reach past the design",
        VERDICT,
        "return low < result.design.lower[i] or high > result.design.upper[i]",
        "return low < result.design.lower[i] and high > result.design.upper[i]",
        VERDICTS,
    ),
    Fault(
        "a value counts, not its interval",
        VERDICT,
        "low, high = e.value - 2.0 * e.sigma, e.value + 2.0 * e.sigma",
        "low = high = e.value",
        VERDICTS,
    ),
    Fault("the lag of least evidence leads", VERDICT, "max(clocks, key", "min(clocks, key", VERDICTS),
    Fault(
        "a lag is named though it explains nothing", VERDICT, "> LATE and lag.explains", "> LATE", VERDICTS
    ),
    Fault("the flyer late makes the force late", CLOCK, "FLYER: (-1.0, -1.0)", "FLYER: (1.0, 1.0)", CLOCKS),
    Fault(
        "a late force shows a later time",
        LAG,
        "np.interp(bins.edges - lag",
        "np.interp(bins.edges + lag",
        CLOCKS,
    ),
    Fault("a late outline shows a later time", LAG, "late = times - lag", "late = times + lag", CLOCKS),
    Fault("the slope of a lag twice as steep", LAG, "/ (2.0 * h)", "/ h", CLOCKS),
    Fault("a slow error has no part in a lag's uncertainty", LAG, "+ float(slow @ slow)", "+ 0.0", CLOCKS),
    Fault(
        "a slow error may take a lag",
        LAG,
        "replace(objective, slowly=False, slow_discrepancy=0.0)",
        "objective",
        CLOCKS,
    ),
    Fault(
        "parameters act at once", LAG, "jacobian = slopes(lag * way)", "jacobian = slopes(0.0 * way)", CLOCKS
    ),
    Fault(
        "what parameters explain is a lag's evidence",
        LAG,
        "vector = vector + jacobian @ change",
        "vector = vector + 0.0 * jacobian @ change",
        CLOCKS,
    ),
    Fault(
        "a step beside a bound leaves it",
        CLOCK,
        "self.upper, -step, step)",
        "self.upper, step, step)",
        CLOCKS,
    ),
    Fault("slopes per step, not per unit", CLOCK, "/ steps[:, None]", "/ 1.0", CLOCKS),
    Fault(
        "inputs have no part in a lag's uncertainty",
        LAG,
        "variance += float((moves**2).mean())",
        "variance += 0.0 * float((moves**2).mean())",
        CLOCKS,
    ),
    Fault(
        "unexplained shots are counted unasked",
        "kolsky/studies/rates/records.py",
        "WITHHELD if self.keep_unexplained else ()",
        "WITHHELD",
        ("tests/unit/studies/test_rates_unexplained.py",),
    ),
    Fault(
        "thresholds without a margin",
        "benchmarks/fit_thresholds.py",
        "MARGIN * np.exp(max(limit, logs.max()))",
        "np.exp(max(limit, logs.max()))",
        ("tests/unit/diagnosis/test_fit_thresholds.py",),
    ),
    Fault(
        "tolerance limit of the sample instead of the population",
        "benchmarks/fit_thresholds.py",
        "quantile * np.sqrt(n)) / np.sqrt(n)",
        "0.0) / np.sqrt(n) + quantile",
        ("tests/unit/diagnosis/test_fit_thresholds.py",),
    ),
    Fault(
        "the solver is never run again for a lag",
        CLOCK,
        "not (leading.significance > LATE and",
        "not (leading.significance < LATE and",
        CLOCKS,
    ),
    Fault(
        "a lag's runs where the search began", CLOCK, "again.x + fit.move", "again.x + 0.0 * fit.move", CLOCKS
    ),
    Fault("one more round of runs is all", CLOCK, "TURNS = 3", "TURNS = 1", CLOCKS),
    Fault(
        "runs for a lag outside the box",
        CLOCK,
        "np.asarray(np.clip(point, self.lower, self.upper))",
        "np.asarray(point)",
        CLOCKS,
    ),
    Fault(
        "runs for a lag begin where a wrong clock led",
        CLOCK,
        "np.where(np.isfinite(self.declared), self.declared, moved)",
        "np.where(np.isfinite(self.declared), moved, moved)",
        CLOCKS,
    ),
    Fault(
        "limits chosen on shots whose search ended elsewhere",
        "benchmarks/threshold_choice.py",
        "abs(e.value - self.truth[name]) > ASTRAY * e.sigma",
        "abs(e.value - self.truth[name]) > 10.0 * ASTRAY * e.sigma",
        CHOICE,
    ),
    Fault(
        "evidence of what is within its declared uncertainty",
        "benchmarks/threshold_choice.py",
        "for cause in result.causes if not cause.within",
        "for cause in result.causes",
        CHOICE,
    ),
    Fault(
        "evidence without a margin",
        "benchmarks/fit_thresholds.py",
        "return MARGIN * max(values)",
        "return max(values)",
        CHOICE,
    ),
    Fault(
        "limits judged on the shots they were chosen on",
        "benchmarks/threshold_choice.py",
        "[limited(s.result)[name] for s in judged if",
        "[limited(s.result)[name] for s in found if",
        CHOICE,
    ),
)
