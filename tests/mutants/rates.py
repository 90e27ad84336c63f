"""Faults of means, scatters and slopes of several shots."""

from tests.mutants.fault import Fault

RATES = ("tests/unit/studies/test_rates_thresholds.py",)
MIXED = ("tests/unit/studies/test_rates_mixed.py", *RATES)

COMMON = ("tests/unit/studies/test_rates_common.py",)

FAULTS = (
    Fault(
        name="one degree of freedom too many in a mean",
        file="kolsky/studies/rates/scatter.py",
        right="freedom=n - p,",
        wrong="freedom=n - p + 1,",
        tests=RATES,
    ),
    Fault(
        name="Knapp and Hartung's factor over the number of values",
        file="kolsky/studies/rates/scatter.py",
        right="scale=_generalised_q(y, s**2 + variance, X) / (n - p),",
        wrong="scale=_generalised_q(y, s**2 + variance, X) / n,",
        tests=RATES,
    ),
    Fault(
        name="a scatter whose Q is the number of values",
        file="kolsky/studies/rates/scatter.py",
        right="return _generalised_q(y, total, X) - (n - p)\n        gain",
        wrong="return _generalised_q(y, total, X) - n\n        gain",
        tests=RATES,
    ),
    Fault(
        name="shots that agree are made more certain by it",
        file="kolsky/studies/rates/scatter.py",
        right="self.covariance[index, index] * max(1.0, self.scale)",
        wrong="self.covariance[index, index] * self.scale",
        tests=RATES,
    ),
    Fault(
        name="what is shared left out of the uncertainty",
        file="kolsky/studies/rates/scatter.py",
        right="return float(np.sqrt(self._own(index) + self.common[index, index]))",
        wrong="return float(np.sqrt(self._own(index)))",
        tests=RATES,
    ),
    Fault(
        name="freedom by the ratio of variances, not its square",
        file="kolsky/studies/rates/scatter.py",
        right="((own + self.common[index, index]) / own) ** 2)",
        wrong="((own + self.common[index, index]) / own))",
        tests=RATES,
    ),
    Fault(
        name="a 90 per cent interval",
        file="kolsky/studies/rates/scatter.py",
        right="student.ppf(0.5 + 0.5 * probability,",
        wrong="student.ppf(probability,",
        tests=RATES,
    ),
    Fault(
        name="I squared without its degrees of freedom",
        file="kolsky/studies/rates/scatter.py",
        right="max(0.0, (self.q - self.freedom) / self.q)",
        wrong="max(0.0, (self.q - 1) / self.q)",
        tests=RATES,
    ),
    Fault(
        name="a prediction without the scatter",
        file="kolsky/studies/rates/scatter.py",
        right="float(np.hypot(self.fit.between, self.sigma))",
        wrong="float(self.sigma)",
        tests=RATES,
    ),
    Fault(
        name="the scatter of a population",
        file="kolsky/studies/rates/scatter.py",
        right="scatter=float(y.std(ddof=1)),",
        wrong="scatter=float(y.std()),",
        tests=RATES,
    ),
    Fault(
        name="the probability of one degree of freedom more",
        file="kolsky/studies/rates/scatter.py",
        right="chi2.sf(self.fit.q, self.fit.freedom)",
        wrong="chi2.sf(self.fit.q, self.fit.freedom + 1)",
        tests=RATES,
    ),
    Fault(
        name="a slope of three shots",
        file="kolsky/studies/rates/scatter.py",
        right="FEWEST = 4",
        wrong="FEWEST = 3",
        tests=RATES,
    ),
    Fault(
        name="a slope over a twentieth of a decade",
        file="kolsky/studies/rates/scatter.py",
        right="LEAST_SPAN = 0.5",
        wrong="LEAST_SPAN = 0.05",
        tests=RATES,
    ),
    Fault(
        name="a slope within the spread of one test",
        file="kolsky/studies/rates/scatter.py",
        right="LEAST_RATIO = 4.0",
        wrong="LEAST_RATIO = 0.4",
        tests=RATES,
    ),
    Fault(
        name="one shot may be the whole lever",
        file="kolsky/studies/rates/scatter.py",
        right="LARGEST_LEVERAGE = 0.9",
        wrong="LARGEST_LEVERAGE = 1.0",
        tests=RATES,
    ),
    Fault(
        name="a slope uncertain by ten times the mean",
        file="kolsky/studies/rates/scatter.py",
        right="LARGEST_HALF_WIDTH = 1.0",
        wrong="LARGEST_HALF_WIDTH = 10.0",
        tests=RATES,
    ),
    Fault(
        name="the whole width of the slope's interval",
        file="kolsky/studies/rates/scatter.py",
        right="width = 0.5 * (high - low) / abs(float(y.mean()))",
        wrong="width = (high - low) / abs(float(y.mean()))",
        tests=RATES,
    ),
    Fault(
        name="the long lever starts at zero",
        file="kolsky/studies/rates/comparison.py",
        right="ends = [(end - 1.0) / decades for end in pooled.interval]",
        wrong="ends = [end / decades for end in pooled.interval]",
        tests=RATES,
    ),
    Fault(
        name="a long lever of a tenth of a decade",
        file="kolsky/studies/rates/comparison.py",
        right="if abs(decades) < 1.0:",
        wrong="if abs(decades) < 0.1:",
        tests=RATES,
    ),
    Fault(
        name="specimens are one size within a fifth",
        file="kolsky/studies/rates/comparison.py",
        right="SAME_SIZE = 0.02",
        wrong="SAME_SIZE = 0.2",
        tests=RATES,
    ),
    Fault(
        name="shared parts counted as a shot's own",
        file="kolsky/studies/rates/records.py",
        right="own = [s for name, s in estimate.noise_parts.items() if name not in COMMON_PARTS]",
        wrong="own = list(estimate.noise_parts.values())",
        tests=RATES,
    ),
    Fault(
        name="the noise of a rate without the logarithm's base",
        file="kolsky/studies/rates/records.py",
        right="self.sigma_rate / (self.nominal_rate * np.log(10.0))",
        wrong="self.sigma_rate / self.nominal_rate",
        tests=RATES,
    ),
    Fault(
        name="a response's roughness in no shot's own part",
        file="kolsky/studies/rates/records.py",
        right='own.append(estimate.numerical_parts.get("roughness", 0.0))',
        wrong="own.append(0.0)",
        tests=COMMON,
    ),
    Fault(
        name="what the mesh leaves with the sign of the shift",
        file="kolsky/studies/rates/records.py",
        right='parts["mesh and step", self.conditions["mesh"]] = mesh',
        wrong='parts["mesh and step", self.conditions["mesh"]] = mesh * np.sign(estimate.mesh_shift)',
        tests=COMMON,
    ),
)
