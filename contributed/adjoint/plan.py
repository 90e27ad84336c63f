"""One simulation in phases: differentiable Warp kernels, constants, a window of rows, and their gradients.

The kernels call the same functions of element, law and boundary as the time loop in one kernel
(`explicit.time_loop.kernel`). Separate kernels are needed because Warp does not differentiate a loop with
state. Here a launch is one phase of one step, and row k + 1 of every field follows from row k. No value that
the reverse pass reads is overwritten.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.arguments import batch_of, body_of, nodal_mass, node_kinds, state_of
from explicit.arrays import FloatArray
from explicit.contact import contact_law
from explicit.device import select_device
from explicit.elements import element as element_named
from explicit.layout.structs import batch_structs
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.platens import CharacteristicBar, MovingSupport
from explicit.precision import PRECISIONS
from explicit.time_loop.kernel import time_loop_kernel
from explicit.time_loop.node_sweeps import INTERIOR, LOWER, UPPER, boundary_functions


@dataclass(frozen=True)
class PhaseKernels:
    """The phases of one law, element and pair of contact laws, in double precision."""

    elements: Any
    """Corner forces of row k; launch with dim = n_elements."""
    nodes: Any
    """Velocities and displacements of row k + 1 and the platens' impulses; launch with dim = n_nodes."""
    support: Any
    """Motion of the transmission platen in front of a bar in row k + 1; launch with dim = 1."""


@cache
def phase_kernels(
    law: type, faces: str, side: str, element_name: str, valence: int, bound: str, volumetric: str
) -> PhaseKernels:
    """Generate the phases; `valence` is the largest number of elements that meet at a node, `bound` that of
    `explicit.model.Stepping`, `volumetric` that of `explicit.Model`."""
    precision = PRECISIONS["fp64"]
    real, vec2, vec4 = precision.real, precision.vec2, precision.vec4
    functions = element_named(element_name).functions(law, precision, bound, volumetric)
    Solid, read_shape, forces = functions.Solid, functions.read_shape, functions.forces
    structs = batch_structs(precision, functions.Shape, Solid)
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    contact = boundary_functions(faces, side, precision, structs).contact
    zero, one, two = real(0.0), real(1.0), real(2.0)
    lower, upper, corners_met = int(LOWER), int(UPPER), int(valence)

    @wp.kernel(module="unique")
    def elements(
        k: int,
        measure: int,
        quads: wp.array2d(dtype=int),
        shapes: wp.array2d(dtype=real),
        solids: wp.array(dtype=Solid),
        row: wp.array(dtype=real),
        u_r: wp.array2d(dtype=real),
        u_y: wp.array2d(dtype=real),
        v_r: wp.array2d(dtype=real),
        v_y: wp.array2d(dtype=real),
        corner_r: wp.array3d(dtype=real),
        corner_y: wp.array3d(dtype=real),
        worst: wp.array(dtype=real),
    ):
        e = wp.tid()
        i, j, m, n = quads[0, e], quads[1, e], quads[2, e], quads[3, e]
        f_r, f_y, omega_squared, _power, _artificial = forces(
            read_shape(shapes, e, measure),
            solids[0],
            row,
            vec4(u_r[k, i], u_r[k, j], u_r[k, m], u_r[k, n]),
            vec4(u_y[k, i], u_y[k, j], u_y[k, m], u_y[k, n]),
            vec4(v_r[k, i], v_r[k, j], v_r[k, m], v_r[k, n]),
            vec4(v_y[k, i], v_y[k, j], v_y[k, m], v_y[k, n]),
            measure,
        )
        for a in range(4):
            corner_r[k, a, e] = f_r[a]
            corner_y[k, a, e] = f_y[a]
        wp.atomic_max(worst, 0, omega_squared)

    @wp.kernel(module="unique")
    def nodes(
        k: int,
        body: Body,
        batch: Batch,
        state: State,
        timing: wp.array2d(dtype=wp.float64),
        length: wp.float64,
        boundary_node: wp.array(dtype=int),
        element_of: wp.array2d(dtype=int),
        corner_of: wp.array2d(dtype=int),
        mass: wp.array(dtype=real),
        inverse_mass: wp.array(dtype=real),
        on_axis: wp.array(dtype=int),
        kind: wp.array(dtype=int),
        reference_y: wp.array(dtype=wp.float64),
        solids: wp.array(dtype=Solid),
        friction: wp.array(dtype=real),
        corner_r: wp.array3d(dtype=real),
        corner_y: wp.array3d(dtype=real),
        touched: wp.array2d(dtype=int),
        u_r: wp.array2d(dtype=real),
        u_y: wp.array2d(dtype=real),
        v_r: wp.array2d(dtype=real),
        v_y: wp.array2d(dtype=real),
        push: wp.array2d(dtype=wp.float64),
        lower_platen: wp.array2d(dtype=wp.float64),
        loaded: wp.array(dtype=wp.float64),
    ):
        n = wp.tid()
        dt, interval, flyer_next = timing[k, 0], timing[k, 1], timing[k, 2]
        solid = solids[0]
        # The corners are unrolled instead of looped over: a missing one reads a column of zeros.
        f_r, f_y = real(0.0), real(0.0)
        for c in range(corners_met):
            f_r += corner_r[k, corner_of[c, n], element_of[c, n]]
            f_y += corner_y[k, corner_of[c, n], element_of[c, n]]
        old = vec2(v_r[k, n], v_y[k, n])
        free = old - interval * (vec2(f_r, f_y) * inverse_mass[n] + solid.mass_damping * old)
        if on_axis[n] == 1:
            free = vec2(zero, free[1])
        new = free
        mark = touched[k, n]
        if kind[n] != 0:
            height = reference_y[n] + u_y[k, n]
            to_lower = (lower_platen[k, 0] + lower_platen[k, 1] * dt - height) / dt
            to_upper = (length - flyer_next - height) / dt
            met, platen, now = contact(
                body, batch, state, 0, boundary_node[n],
                kind[n], touched[k, n], free, to_lower, to_upper, friction[0], interval, dt,
            )  # fmt: skip
            new = met
            mark = now
            kick = mass[n] * (met[1] - free[1])
            if platen == lower:
                wp.atomic_add(push, k, 1, kick)
                if met[1] == to_lower:
                    wp.atomic_add(loaded, k, mass[n])
            elif platen == upper:
                wp.atomic_add(push, k, 0, kick)
        touched[k + 1, n] = mark
        v_r[k + 1, n] = new[0]
        v_y[k + 1, n] = new[1]
        u_r[k + 1, n] = u_r[k, n] + dt * new[0]
        u_y[k + 1, n] = u_y[k, n] + dt * new[1]

    @wp.kernel(module="unique")
    def support(
        k: int,
        timing: wp.array2d(dtype=wp.float64),
        impedance: wp.float64,
        push: wp.array2d(dtype=wp.float64),
        loaded: wp.array(dtype=wp.float64),
        returned: wp.array(dtype=wp.float64),
        lower_platen: wp.array2d(dtype=wp.float64),
        outgoing: wp.array(dtype=wp.float64),
    ):
        # As in the time loop: v = F / Z + 2 h, with the mass that the platen carries.
        dt, interval = timing[k, 0], timing[k, 1]
        speed = lower_platen[k, 1]
        inertia = loaded[k] / (interval * impedance)
        answer = -(push[k, 1] / interval / impedance + two * returned[k])
        new = (inertia * speed + answer) / (one + inertia)
        lower_platen[k + 1, 0] = lower_platen[k, 0] + speed * dt
        lower_platen[k + 1, 1] = new
        outgoing[k] = -new - returned[k]

    return PhaseKernels(elements, nodes, support)


FIELDS = ("u_r", "u_y", "v_r", "v_y", "lower_platen")
"""The fields of the state that carry a gradient: of the nodes, and position and speed of a moving support."""
SUMS = ("push", "loaded")
"""Sums over the nodes in each step: impulses of both platens, and the mass that the support carries."""


@dataclass(frozen=True)
class Window:
    """Rows of the fields for a number of consecutive steps: step k leads from row k to row k + 1. Every entry
    is a Warp array; `view` is the same memory as a NumPy array."""

    arrays: dict[str, Any]
    view: dict[str, NDArray[Any]]
    """The same memory as NumPy arrays."""
    gradient: dict[str, FloatArray]

    @property
    def n_steps(self) -> int:
        """Number of steps of the window."""
        return len(self.view["timing"])

    def state(self, k: int) -> dict[str, NDArray[Any]]:
        """A copy of row k of the state."""
        return {name: self.view[name][k].copy() for name in (*FIELDS, "touched")}

    def begin(self, state: dict[str, NDArray[Any]]) -> None:
        """Put a state into row 0."""
        for name, values in state.items():
            self.view[name][0] = values
        for name in SUMS:
            self.view[name][:] = 0.0

    def clear_gradients(self) -> None:
        """Set the gradients of the rows to zero; those of the parameters continue to accumulate."""
        for name in (*FIELDS, *SUMS, "corner_r", "corner_y", "returned", "outgoing"):
            self.gradient[name][:] = 0.0

    @property
    def memory(self) -> int:
        """Memory of the rows and their gradients [B]."""
        return sum(a.nbytes for a in (*self.view.values(), *self.gradient.values()))


@dataclass(frozen=True)
class PhasePlan:
    """One simulation, ready to run in phases on the CPU in double precision."""

    model: Model
    samples: Samples
    """Its parameters: one sample."""
    stepping: Stepping
    kernels: PhaseKernels
    window: Window
    element_inputs: tuple[Any, ...]
    """Arguments of the elements' phase after k and `measure`."""
    node_inputs: tuple[Any, ...]
    """Arguments of the nodes' phase after k."""
    support_inputs: tuple[Any, ...]
    """Arguments of the support's phase after k."""

    @property
    def moving(self) -> bool:
        """True if the support moves."""
        return bool(np.isfinite(self.support.impedance))

    @property
    def support(self) -> CharacteristicBar:
        """The support, of the kind that has an adjoint."""
        assert isinstance(self.model.support, CharacteristicBar)
        return self.model.support

    @cached_property
    def _elements(self) -> Any:
        return self._launch_elements(0, prepare=True)

    @cached_property
    def _nodes(self) -> Any:
        return self._launch_nodes(0, prepare=True)

    @cached_property
    def _support(self) -> Any:
        return self._launch_support(0, prepare=True)

    def _launch_elements(self, k: int, *, prepare: bool = False) -> Any:
        n, inputs = self.model.mesh.n_elements, [k, 0, *self.element_inputs]
        return wp.launch(self.kernels.elements, dim=n, inputs=inputs, device="cpu", record_cmd=prepare)

    def _launch_nodes(self, k: int, *, prepare: bool = False) -> Any:
        n, inputs = self.model.mesh.n_nodes, [k, *self.node_inputs]
        return wp.launch(self.kernels.nodes, dim=n, inputs=inputs, device="cpu", record_cmd=prepare)

    def _launch_support(self, k: int, *, prepare: bool = False) -> Any:
        inputs = [k, *self.support_inputs]
        return wp.launch(self.kernels.support, dim=1, inputs=inputs, device="cpu", record_cmd=prepare)

    def sweep_elements(self, k: int, measure: int = 0) -> None:
        """The first phase of step k: corner forces, and the step's bound if it is measured."""
        self._elements.set_param_at_index(0, k)  # a prepared launch costs a fifth of a new one
        self._elements.set_param_at_index(1, measure)
        self._elements.launch()

    def sweep_nodes(self, k: int) -> None:
        """The other phases of step k: nodes and platens, and the support if it moves."""
        self._nodes.set_param_at_index(0, k)
        self._nodes.launch()
        if self.moving:
            self._support.set_param_at_index(0, k)
            self._support.launch()

    def taped(self, n_steps: int) -> Any:
        """Run steps 0 to `n_steps` - 1 and return their tape."""
        tape = wp.Tape()
        with tape:
            for k in range(n_steps):
                self._launch_elements(k)
                self._launch_nodes(k)
                if self.moving:
                    self._launch_support(k)
        return tape


def plan(model: Model, samples: Samples, stepping: Stepping, n_steps: int) -> PhasePlan:
    """Prepare one simulation on the CPU with a window of `n_steps` steps.

    Raises ValueError if there is not exactly one sample, or it refers to a missing material or motion. If the
    precision is single, or the support or a contact law has no adjoint.
    """
    if len(samples) != 1:
        raise ValueError(f"samples must be one sample, the point to differentiate at, got {len(samples)}")
    for name, index, count in (
        ("material", int(samples.material[0]), len(model.materials)),
        ("motion", int(samples.motion[0]), len(model.motions)),
    ):
        if not 0 <= index < count:
            raise ValueError(f"the sample names {name} {index}, the model has 0 to {count - 1}")
    if stepping.precision != "fp64":
        raise ValueError(f"the adjoint runs in 'fp64', got precision {stepping.precision!r}")
    if model.relaxation:
        raise ValueError(
            "the adjoint knows no branches that relax, got a model with relaxation; use "
            "perturbed_runs.jacobian"
        )
    if isinstance(model.support, MovingSupport):
        raise ValueError(
            "the adjoint knows a rigid support and a bar, got a support with a motion of its own"
        )
    if any(contact_law(name).remembers_slip for name in (model.faces, model.side)):
        raise ValueError(
            f"the adjoint knows no contact law that remembers its slip, got faces {model.faces!r} and side "
            f"{model.side!r}; use 'coulomb'"
        )
    device = select_device("cpu")
    mesh, numbers = model.mesh, PRECISIONS["fp64"]
    law = type(model.materials[0])
    choices = {"bound": stepping.bound, "volumetric": model.volumetric}
    loop = time_loop_kernel(law, model.faces, model.side, numbers, model.element, **choices)
    body = body_of(loop, model, numbers, device)
    no_samples = Sampling(np.array([model.start]), np.array([model.start]))
    batch = batch_of(loop, model, samples, no_samples, stepping, numbers, device)
    state = state_of(loop, model, numbers, device, 1, 1)
    batch.solids.requires_grad = True
    batch.friction.requires_grad = True
    start, corner = mesh.corners_of_node
    met = np.diff(start)
    element_of = np.full((int(met.max()), mesh.n_nodes), mesh.n_elements, dtype=np.int32)
    corner_of = np.zeros_like(element_of)
    for c in range(len(element_of)):
        used = met > c
        element_of[c, used] = corner[start[:-1][used] + c] // 4
        corner_of[c, used] = corner[start[:-1][used] + c] % 4
    row = model.materials[int(samples.material[0])].parameters()
    window = _window(mesh.n_nodes, mesh.n_elements, n_steps, row, batch)
    a = window.arrays
    fields = tuple(a[name] for name in ("u_r", "u_y", "v_r", "v_y"))
    mass, kind = nodal_mass(mesh, model.density), node_kinds(mesh)
    on_boundary = kind != INTERIOR

    def integers(values: NDArray[Any]) -> Any:
        return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=int, device=device)

    def numbers_of(values: FloatArray) -> Any:
        return wp.array(values, dtype=wp.float64, device=device)

    return PhasePlan(
        model=model,
        samples=samples,
        stepping=stepping,
        kernels=phase_kernels(law, model.faces, model.side, model.element, len(element_of), **choices),
        window=window,
        element_inputs=(
            *(integers(mesh.quads.T), body.shapes, a["solids"], a["row"]),
            *(*fields, a["corner_r"], a["corner_y"], a["worst"]),
        ),
        node_inputs=(
            *(body, batch, state, a["timing"], mesh.length),
            *(integers(np.where(on_boundary, np.cumsum(on_boundary) - 1, -1)), integers(element_of)),
            *(integers(corner_of), numbers_of(mass), numbers_of(1.0 / mass), integers(mesh.on_axis)),
            *(integers(kind), numbers_of(mesh.nodes[:, 1] - mesh.nodes[:, 1].min())),
            *(a["solids"], a["friction"], a["corner_r"], a["corner_y"], a["touched"], *fields),
            *(a["push"], a["lower_platen"], a["loaded"]),
        ),
        support_inputs=(
            *(a["timing"], min(model.support.impedance, 1e300), a["push"], a["loaded"]),
            *(a["returned"], a["lower_platen"], a["outgoing"]),
        ),
    )


def _window(n_nodes: int, n_elements: int, n_steps: int, row: FloatArray, batch: Any) -> Window:
    def room(*shape: int) -> Any:
        return wp.zeros(shape, dtype=wp.float64, device="cpu", requires_grad=True)

    arrays = {name: room(n_steps + 1, n_nodes) for name in ("u_r", "u_y", "v_r", "v_y")}
    arrays["lower_platen"] = room(n_steps + 1, 2)
    for name in ("loaded", "returned", "outgoing"):
        arrays[name] = room(n_steps)
    for name in ("corner_r", "corner_y"):
        arrays[name] = room(n_steps, 4, n_elements + 1)  # the last column is zero
    arrays["push"] = room(n_steps, 2)
    arrays["row"] = wp.array(row, dtype=wp.float64, device="cpu", requires_grad=True)
    arrays["solids"], arrays["friction"] = batch.solids, batch.friction
    arrays["touched"] = wp.zeros((n_steps + 1, n_nodes), dtype=int, device="cpu")
    arrays["timing"] = wp.zeros((n_steps, 3), dtype=wp.float64, device="cpu")
    arrays["worst"] = wp.zeros(1, dtype=wp.float64, device="cpu")
    gradient = {name: a.grad.numpy() for name, a in arrays.items() if a.requires_grad}
    return Window(arrays, {name: a.numpy() for name, a in arrays.items()}, gradient)
