"""Faults in the arithmetic of equilibria and of their derivatives."""

from tests.mutants.fault import Fault

_UNIT = "tests/unit/implicit"
_SOLIDS = f"{_UNIT}/test_solids.py"
_CLOSED = f"{_UNIT}/test_implicit_closed_forms.py"
_DERIVATIVES = f"{_UNIT}/test_sensitivity.py"
_QUASI = f"{_UNIT}/test_quasi_newton.py"

FAULTS = (
    Fault(
        "pressure part of the tangent with the wrong sign",
        "implicit/laws/kernels/compressible.py",
        "(stiffness + quotient) * H[i, r]",
        "(stiffness - quotient) * H[i, r]",
        (f"{_SOLIDS}::test_stress_and_tangent_are_derivatives_of_the_energy",),
    ),
    Fault(
        "volumetric polynomial with a wrong exponent",
        "implicit/laws/volumetric.py",
        "6.0 * x**5",
        "5.0 * x**5",
        (f"{_SOLIDS}::test_volumetric_forms_are_derivatives_of_their_energy",),
    ),
    Fault(
        "Gauss points of the tetrahedron of degree 2",
        "implicit/elements/quadrature.py",
        "(5.0 - 5.0**0.5) / 20.0",
        "(5.0 - 5.0**0.5) / 21.0",
        (f"{_UNIT}/test_implicit_elements.py::test_rules_are_exact",),
    ),
    Fault(
        "unmatched mass of the mixed field",
        "implicit/integration/mixed.py",
        "solved = np.matmul(self.inverse, C)",
        "solved = C",
        (f"{_DERIVATIVES}::test_direct_is_the_difference",),
    ),
    Fault(
        "derivatives of plane stress without the thickness",
        "implicit/integration/body.py",
        "by_row[:, :, [0, 1, 3, 4]] - state.points.H",
        "by_row[:, :, [0, 1, 3, 4]] + state.points.H",
        (f"{_DERIVATIVES}::test_direct_is_the_difference",),
    ),
    Fault(
        "half a revolution",
        "implicit/integration/geometry.py",
        "volumes * (2.0 * np.pi * radius)",
        "volumes * (np.pi * radius)",
        (f"{_CLOSED}::test_thick_cylinder_under_pressure",),
    ),
    Fault(
        "a pressure that pulls",
        "implicit/loads/pressure.py",
        'force = -np.einsum("g,ga,fgi->fai"',
        'force = np.einsum("g,ga,fgi->fai"',
        (f"{_CLOSED}::test_a_follower_pressure_presses_on_the_deformed_face",),
    ),
    Fault(
        "weight not taken off the force of a support",
        "implicit/solve.py",
        "(state.body.forces - state.carried)",
        "(state.body.forces)",
        (f"{_CLOSED}::test_weight_is_what_the_support_carries",),
    ),
    Fault(
        "contact forces of the penalty alone",
        "implicit/loads/contact.py",
        "np.maximum(0.0, multipliers - self.stiffness",
        "np.maximum(0.0, 0.5 * multipliers - self.stiffness",
        (f"{_CLOSED}::test_a_rigid_plane_is_a_prescribed_face",),
    ),
    Fault(
        "components of one unknown added once",
        "implicit/linear/kernels/fronts.py",
        "column[take[a]];\n        for (int a = middle",
        "0 * column[take[a]];\n        for (int a = middle",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "du/dp with the wrong sign",
        "implicit/sensitivity.py",
        "factors(elements, state).solve(-right.T).T",
        "factors(elements, state).solve(right.T).T",
        (f"{_DERIVATIVES}::test_direct_is_the_difference",),
    ),
    Fault(
        "dF/dp at fixed displacements",
        "implicit/sensitivity.py",
        "forces = explicit + equations.times(",
        "forces = explicit + 0.0 * equations.times(",
        (f"{_DERIVATIVES}::test_direct_is_the_difference",),
    ),
    Fault(
        "adjoint with the wrong sign",
        "implicit/sensitivity.py",
        "test = weight - equations.expanded(lam)",
        "test = weight + equations.expanded(lam)",
        (f"{_DERIVATIVES}::test_the_adjoint_is_the_direct_one",),
    ),
    Fault(
        "second derivatives without the response of the displacements",
        "implicit/second.py",
        "change.reshape(n * n, -1) + equations.times(elements, moved)",
        "change.reshape(n * n, -1)",
        (f"{_DERIVATIVES}::test_second_derivatives_are_differences_of_the_first",),
    ),
    Fault(
        "linear: what couples a leaf to its boundary with the wrong sign",
        "implicit/linear/kernels/fronts.py",
        "under[at[a]] += column[take[a]];\n        if",
        "under[at[a]] -= column[take[a]];\n        if",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "linear: rows exchanged the wrong way back",
        "implicit/linear/multifrontal.py",
        "x[own][rows] = solved",
        "x[own] = solved[rows]",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "linear: of two components of one unknown one entry",
        "implicit/linear/kernels/fronts.py",
        "(j < p ? upper : under)[j] += column",
        "(j < p ? upper : under)[j] += 0 * column",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "linear: what a half left with the wrong sign",
        "implicit/linear/kernels/fronts.py",
        "into[a] += from[source + a]",
        "into[a] -= from[source + a]",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "linear: forward substitution with the wrong sign",
        "implicit/linear/kernels/substitution.py",
        "x.data[outside.data[at_outside + i]] -= sum[i]",
        "x.data[outside.data[at_outside + i]] += sum[i]",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "linear: backward substitution without the last of sixteen",
        "implicit/linear/kernels/substitution.py",
        "for (int k = 0; k < 16; ++k) sum -= part[k]",
        "for (int k = 0; k < 15; ++k) sum -= part[k]",
        (f"{_UNIT}/test_linear.py::test_against_a_dense_solver",),
    ),
    Fault(
        "a kept tangent that learns along negative stiffness",
        "implicit/quasi_newton.py",
        "if self.learns and work > 0.0",
        "if self.learns",
        (f"{_QUASI}::test_what_would_spoil_the_formula_is_not_learnt",),
    ),
    Fault(
        "the second recursion of BFGS with the wrong sign",
        "implicit/quasi_newton.py",
        "(share - float(change @ found) / work)",
        "(share + float(change @ found) / work)",
        (f"{_QUASI}::test_the_formula_is_that_of_bfgs",),
    ),
    Fault(
        "a history continued by all states always",
        "implicit/solve.py",
        "best = int(np.argmin(errors))",
        "best = len(errors) - 1",
        (f"{_QUASI}::test_beyond_a_kink_few_states_are_taken",),
    ),
    Fault(
        "tangents that are never kept",
        "implicit/newton.py",
        "        if not serves:",
        "        if serves:",
        (f"{_QUASI}::test_a_smooth_history_takes_fewer_factorisations_than_steps",),
    ),
)
