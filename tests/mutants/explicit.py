"""Faults of the solver: masses, forces, energies, the stable step, contact, relaxation, moduli."""

from tests.mutants.fault import Fault

FORMS = "tests/unit/explicit/test_closed_forms.py"
ONE_ELEMENT = (f"{FORMS}::test_forces_are_the_gradient_of_the_energies",)
LEDGER = (f"{FORMS}::test_every_term_of_the_ledger_is_there",)
STEP = (f"{FORMS}::test_the_step_bound_is_just_above_the_largest_frequency",)
CONTACT = ("tests/unit/explicit/test_contact_laws.py",)
PACKS = ("tests/unit/explicit/test_simd_solver.py",)

SHARED_BITS = (
    "tests/unit/explicit/test_simd_solver.py::test_threads_that_share_a_simulation_agree_bit_for_bit[deviatoric]",
)

FAULTS = (
    Fault(
        name="a node has the mass of one of its elements only",
        file="explicit/arguments.py",
        right="np.add.at(mass, mesh.quads.ravel(), shares.ravel())",
        wrong="mass[mesh.quads.ravel()] = shares.ravel()",
        tests=(f"{FORMS}::test_lumped_masses_have_the_mass_and_its_centre",),
    ),
    Fault(
        name="the drag of mass-proportional damping is dropped",
        file="explicit/time_loop/node_sweeps.py",
        right="old - interval * (push + alpha * old)",
        wrong="old - interval * push",
        tests=(f"{FORMS}::test_newtons_law_of_the_whole_specimen",),
    ),
    Fault(
        name="kinetic energy without its half",
        file="explicit/time_loop/node_sweeps.py",
        right="wp.float64(half * mass * wp.dot(old, new))",
        wrong="wp.float64(mass * wp.dot(old, new))",
        tests=LEDGER,
    ),
    Fault(
        name="work of friction counted twice",
        file="explicit/time_loop/node_sweeps.py",
        right="rubbed = add_to(rubbed, -rub * slide, b)",
        wrong="rubbed = add_to(rubbed, wp.float64(-2.0) * rub * slide, b)",
        tests=LEDGER,
    ),
    Fault(
        name="half of the hourglass coefficient",
        file="explicit/arguments.py",
        right='solids["hourglass"] = stiff * mu',
        wrong='solids["hourglass"] = 0.5 * stiff * mu',
        tests=(f"{FORMS}::test_hourglass_energy_is_its_share_of_what_one_point_misses",),
    ),
    Fault(
        name="hourglass force of the radial motion doubled",
        file="explicit/elements/one_point.py",
        right="g_r = shape.hourglass_r * solid.hourglass * q_r",
        wrong="g_r = two * shape.hourglass_r * solid.hourglass * q_r",
        tests=ONE_ELEMENT,
    ),
    Fault(
        name="the stable step is half of the bound",
        file="explicit/time_loop/steps.py",
        right="batch.safety * TWO / wp.sqrt(omega_squared)",
        wrong="batch.safety / wp.sqrt(omega_squared)",
        tests=STEP,
    ),
    Fault(
        name="the volumetric part is missing in the step bound",
        file="explicit/elements/one_point.py",
        right="shape.volume * (bulk * rank_one + shear * spread)",
        wrong="shape.volume * (shear * spread)",
        tests=STEP,
    ),
    Fault(
        name="Coulomb's bound without the coefficient",
        file="explicit/contact/coulomb.py",
        right="wp.abs(touch.v_r) - touch.friction * wp.abs(touch.target - touch.v_y)",
        wrong="wp.abs(touch.v_r) - wp.abs(touch.target - touch.v_y)",
        tests=CONTACT,
    ),
    Fault(
        name="a bond breaks at half its stress",
        file="explicit/contact/bonded_release.py",
        right="touch.density * away / touch.interval >= touch.release_stress",
        wrong="touch.density * away / touch.interval >= real(0.5) * touch.release_stress",
        tests=CONTACT,
    ),
    Fault(
        name="a branch relaxes by x instead of 2 x / (2 + x)",
        file="explicit/relaxation/prony.py",
        right="rise = two * x / (two + x)",
        wrong="rise = x",
        tests=("tests/unit/explicit/test_relaxation_points.py",),
    ),
    Fault(
        name="bulk modulus with 1 - nu for 1 - 2 nu",
        file="explicit/materials/volumetric.py",
        right="(3.0 * (1.0 - 2.0 * nu))",
        wrong="(3.0 * (1.0 - nu))",
        tests=(
            "tests/unit/explicit/test_explicit_inputs.py::test_bulk_modulus_is_that_of_linear_elasticity",
        ),
    ),
    Fault(
        name="pressure of the logarithmic law without 1 / J",
        file="explicit/materials/volumetric.py",
        right="return bulk * logarithm(jacobian, dilatation) / jacobian",
        wrong="return bulk * logarithm(jacobian, dilatation)",
        tests=("tests/unit/explicit/test_material_kernels.py::test_every_volumetric_form_is_its_twin",),
    ),
    Fault(
        name="the wave in the bar comes back once instead of twice",
        file="explicit/time_loop/steps.py",
        right="TWO * returned)",
        wrong="returned)",
        tests=(f"{FORMS}::test_a_free_bar_answers_with_every_reflection",),
    ),
    Fault(
        name="deviatoric viscosity halved",
        file="explicit/elements/fbar.py",
        right="eta = two * solid.shear_viscosity * jacobian",
        wrong="eta = solid.shear_viscosity * jacobian",
        tests=(f"{FORMS}::test_deviatoric_damping_takes_two_eta_d_d",),
    ),
    Fault(
        name="what is left of a batch is counted for one thread",
        file="explicit/drivers.py",
        right="rest = n_samples % (threads * lanes)",
        wrong="rest = n_samples % lanes",
        tests=PACKS,
    ),
    Fault(
        name="idle threads take one by one what packs do sooner",
        file="explicit/drivers.py",
        right="if -(-rest // threads) < WORTH_A_PACK * lanes else n_samples",
        wrong="if rest // threads < lanes else n_samples",
        tests=PACKS,
    ),
    Fault(
        name="turns that depend on each other are torn apart",
        file="explicit/simd/memory.py",
        right="if found is None or _depend(loop, found):",
        wrong="if found is None:",
        tests=("tests/unit/explicit/test_two_passes.py",),
    ),
    Fault(
        name="every turn's second half has what the first turn kept",
        file="explicit/simd/memory.py",
        right="kept_{name}[turn];",
        wrong="kept_{name}[0];",
        tests=("tests/unit/explicit/test_two_passes.py",),
    ),
    Fault(
        name="another choice of lanes finds a time loop that is not its own",
        file="explicit/simd/kernel.py",
        right="_package() + choice.encode()",
        wrong="_package()",
        tests=("tests/unit/explicit/test_kept_code.py",),
    ),
    Fault(
        name="the other element is looked at on a machine that knows its time loops",
        file="explicit/run_batch.py",
        right="if wanted:",
        wrong="if problems:",
        tests=("tests/unit/explicit/test_compiling.py",),
    ),
    Fault(
        name="arrays of one copy overlap",
        file="explicit/arguments.py",
        right="end += -(-max(numbers.nbytes, 1) // APART) * APART",
        wrong="end += max(numbers.nbytes, 1) // APART * APART",
        tests=("tests/unit/explicit/test_one_copy.py",),
    ),
    Fault(
        name="page-locked memory is used again while its result lives",
        file="explicit/drivers.py",
        right="finalize(owner, self._free.append, piece).atexit = False",
        wrong="self._free.append(piece)",
        tests=("tests/unit/explicit/test_page_locked.py",),
    ),
    Fault(
        name="the forces of a large mesh are looked for as on one chip",
        file="explicit/arguments.py",
        right="if on_chip and not spread else",
        wrong="if on_chip else",
        tests=("tests/unit/explicit/test_several_chips.py",),
    ),
    Fault(
        name="boundary nodes lie among the interior's on several chips",
        file="explicit/layout/state.py",
        right="np.where(nodes < first_boundary, inner,",
        wrong="np.where(nodes >= 0, inner,",
        tests=("tests/unit/explicit/test_several_chips.py",),
    ),
    Fault(
        name="more blocks are asked for than multiprocessors are free",
        file="explicit/layout/lanes.py",
        right="n_samples * cluster <= SPREAD * device.sm_count",
        wrong="n_samples <= SPREAD * device.sm_count",
        tests=("tests/unit/explicit/test_clusters.py",),
    ),
    Fault(
        name="the first thread's shares of a sum are taken for kept ones",
        file="explicit/simd/mappings.py",
        right="for (int {at} = team_op::end({n.code}, 0, members);",
        wrong="for (int {at} = 0;",
        tests=SHARED_BITS,
    ),
    Fault(
        name="every thread sweeps the nodes of a sum",
        file="explicit/simd/mappings.py",
        right="(keeps_books ? 0 : {n.code})",
        wrong="0",
        tests=SHARED_BITS,
    ),
    Fault(
        name="threads join a mesh that has no work for them",
        file="explicit/simd/team.py",
        right="min(threads, self._n_elements // ELEMENTS_EACH, MOST_SEATS)",
        wrong="min(threads, MOST_SEATS)",
        tests=("tests/unit/explicit/test_shared_run.py",),
    ),
    Fault(
        name="threads join launches that are at their end when a thread is idle",
        file="explicit/drivers.py",
        right="jobs[max(len(jobs) - threads + 1, 0) :]",
        wrong="jobs[:]",
        tests=("tests/unit/explicit/test_shared_run.py",),
    ),
)
