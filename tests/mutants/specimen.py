"""Faults of whole specimens: fits with errors in both, intervals, bonds, sheets and their sensitivities."""

from tests.mutants.fault import Fault

HERE = "tests/unit/specimen"
FITS = (f"{HERE}/test_errors_in_variables.py",)
SAYS = (f"{HERE}/test_intervals.py",)
FIELD = (f"{HERE}/test_field_sensitivity.py",)
CURVE = (f"{HERE}/test_curve.py",)
BONDS = (f"{HERE}/test_debonding.py",)
POINTS = (f"{HERE}/test_projection.py",)
SHEET = (f"{HERE}/test_sheet_simulation.py",)
SECOND = (f"{HERE}/test_sheet.py::test_second_derivatives_are_those_of_the_gradient",)

FAULTS = (
    Fault(
        name="specimen: the displacement's noise left out of the variance",
        file="kolsky/bodies/errors_in_variables.py",
        right="samples.sigma_displacement**2 * k @ np.swapaxes(k, -1, -2)",
        wrong="0.0 * k @ np.swapaxes(k, -1, -2)",
        tests=FITS,
    ),
    Fault(
        name="specimen: half the way to the best displacement",
        file="kolsky/bodies/errors_in_variables.py",
        right='np.einsum("nji,nj->ni", there.by_displacement, weighed)',
        wrong='0.5 * np.einsum("nji,nj->ni", there.by_displacement, weighed)',
        tests=FITS,
    ),
    Fault(
        name="specimen: the way to the linearised displacement forgotten",
        file="kolsky/bodies/errors_in_variables.py",
        right="    r = r + there.by_constants @ step\n",
        wrong="    r = there.force - samples.force + there.by_constants @ step\n",
        tests=FITS,
    ),
    Fault(
        name="specimen: w_f upside down",
        file="kolsky/bodies/errors_in_variables.py",
        right="(self.sigma_displacement / self.sigma_force) ** 2",
        wrong="(self.sigma_force / self.sigma_displacement) ** 2",
        tests=FITS,
    ),
    Fault(
        name="specimen: a misfit that does not widen",
        file="kolsky/bodies/specimen_fit.py",
        right="max(1.0, chi2 / degrees) * inflation(alike)",
        wrong="1.0 * inflation(alike)",
        tests=SAYS,
    ),
    Fault(
        name="specimen: like neighbours that do not widen",
        file="kolsky/bodies/specimen_fit.py",
        right="return (1.0 + rho) / (1.0 - rho)",
        wrong="return 1.0",
        tests=SAYS,
    ),
    Fault(
        name="specimen: degrees of freedom without the constants",
        file="kolsky/bodies/specimen_fit.py",
        right="degrees = len(reduced.residual) - len(free)",
        wrong="degrees = len(reduced.residual)",
        tests=SAYS,
    ),
    Fault(
        name="specimen: a correlation of 0.97 not said",
        file="kolsky/bodies/specimen_fit.py",
        right="TOGETHER = 0.95\n",
        wrong="TOGETHER = 0.9975\n",
        tests=SAYS,
    ),
    Fault(
        name="specimen: a constant that is known well called hidden",
        file="kolsky/bodies/specimen_fit.py",
        right="NARROW = 0.1\n",
        wrong="NARROW = 0.01\n",
        tests=SAYS,
    ),
    Fault(
        name="specimen: bulk modulus by Poisson's ratio a half too small",
        file="kolsky/bodies/specimen_constants.py",
        right="polynomial(0.5 * modulus,",
        wrong="polynomial(modulus,",
        tests=(f"{HERE}/test_constants.py",),
    ),
    Fault(
        name="bonds: a peeling that the constants imitate counted in full",
        file="kolsky/bodies/specimen_fit.py",
        right="seen = template - basis @ (basis.T @ template)",
        wrong="seen = template",
        tests=BONDS,
    ),
    Fault(
        name="bonds: a stiffer specimen called peeling",
        file="kolsky/bodies/specimen_fit.py",
        right="return self.z > LIMIT",
        wrong="return abs(self.z) > LIMIT",
        tests=BONDS,
    ),
    Fault(
        name="bonds: the scatter of the residuals left out",
        file="kolsky/bodies/specimen_fit.py",
        right="sigma = float(np.sqrt(scale / information))",
        wrong="sigma = float(np.sqrt(1.0 / information))",
        tests=BONDS,
    ),
    Fault(
        name="sheet: variance as a sum of sizes",
        file="kolsky/bodies/sheet_fit.py",
        right="((change * np.asarray(sigma)) ** 2).sum(axis=1)",
        wrong="(np.abs(change) * np.asarray(sigma) ** 2).sum(axis=1)",
        tests=FIELD,
    ),
    Fault(
        name="sheet: sign of the change of a fit",
        file="kolsky/bodies/sheet_fit.py",
        right="return np.asarray(-cho_solve(factor",
        wrong="return np.asarray(cho_solve(factor",
        tests=FIELD,
    ),
    Fault(
        name="sheet: a direction that is not seen taken for one that is",
        file="kolsky/bodies/sheet_fit.py",
        right="SMALLEST_EIGENVALUE = 1e-9\n",
        wrong="SMALLEST_EIGENVALUE = -1.0\n",
        tests=FIELD,
    ),
    Fault(
        name="points: the noise of an extrapolated prediction forgotten",
        file="kolsky/bodies/sheet.py",
        right="deviation = np.abs(field - expected) / np.sqrt(1.0 + (weights**2).sum(axis=1))[:, None]",
        wrong="deviation = np.abs(field - expected)",
        tests=POINTS,
    ),
    Fault(
        name="points: noise too large by the prediction's own",
        file="kolsky/bodies/sheet.py",
        right="deviation = np.abs(values - expected) / np.sqrt(1.0 + (weights**2).sum(axis=1))[:, None]",
        wrong="deviation = np.abs(values - expected)",
        tests=POINTS,
    ),
    Fault(
        name="curve: correlations of the constants left out of its band",
        file="kolsky/bodies/specimen_constants.py",
        right="modes = (vectors * np.sqrt(np.maximum(values, 0.0))).T @ np.array(slopes)",
        wrong="modes = np.diag(np.sqrt(np.diag(covariance))) @ np.array(slopes)",
        tests=CURVE,
    ),
    Fault(
        name="plan: tests together no better than one",
        file="kolsky/bodies/specimen_studies.py",
        right="jacobian = np.concatenate([whitened[name] for name in tests]) * sizes",
        wrong="jacobian = whitened[tests[0]] * sizes",
        tests=CURVE,
    ),
    Fault(
        name="map: the penalty of a border linear in nothing",
        file="kolsky/bodies/stiffness_map.py",
        right="np.add.at(gradient, j, -length * apart / root)",
        wrong="np.add.at(gradient, j, length * apart / root)",
        tests=(f"{HERE}/test_stiffness_map.py::test_total_variation_of_a_step",),
    ),
    Fault(
        name="plan: a sheet's field with the area left out",
        file="kolsky/bodies/sheet_reading.py",
        right="variance = data.area * data.sigma_displacement**2",
        wrong="variance = data.sigma_displacement**2",
        tests=SHEET,
    ),
    Fault(
        name="plan: a sheet's force with its variance for its deviation",
        file="kolsky/bodies/sheet_reading.py",
        right="cost.state.force_by_constants / data.sigma_force}",
        wrong="cost.state.force_by_constants / data.sigma_force**2}",
        tests=SHEET,
    ),
    Fault(
        name="sheet: noise of the displacements added to the force",
        file="kolsky/bodies/sheet_reading.py",
        right="u = u + problem.data.sigma_displacement *",
        wrong="u = u + 2.0 * problem.data.sigma_displacement *",
        tests=SHEET,
    ),
    Fault(
        name="sheet: second derivatives of the force forgotten",
        file="kolsky/bodies/sheet_fit.py",
        right="left += data.weight * np.einsum",
        wrong="left += 0.0 * np.einsum",
        tests=SECOND,
    ),
    Fault(
        name="sheet: the bent map to the energy's constants forgotten",
        file="kolsky/bodies/sheet_fit.py",
        right='u_ij += np.einsum("npad,pij->nijad", u_p, bent)',
        wrong='u_ij += 0.0 * np.einsum("npad,pij->nijad", u_p, bent)',
        tests=SECOND,
    ),
    Fault(
        name="constants: half of the map's second derivatives",
        file="kolsky/bodies/specimen_constants.py",
        right="0.5 * (whole + np.swapaxes(whole, 1, 2))",
        wrong="0.25 * (whole + np.swapaxes(whole, 1, 2))",
        tests=(f"{HERE}/test_constants.py::test_changes_of_the_map_to_the_energy",),
    ),
    Fault(
        name="quasi-Newton: the gradient by the constants uphill",
        file="kolsky/bodies/errors_in_variables.py",
        right='gradient += 2.0 * np.einsum("nip,ni->p"',
        wrong='gradient -= 2.0 * np.einsum("nip,ni->p"',
        tests=FITS,
    ),
    Fault(
        name="quasi-Newton: a displacement moves no force",
        file="kolsky/bodies/errors_in_variables.py",
        right="own.sigma_displacement**2 + 2.0 * pulled",
        wrong="own.sigma_displacement**2 + 0.0 * pulled",
        tests=FITS,
    ),
)
