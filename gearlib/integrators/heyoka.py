"""Runs with heyoka: Taylor steps of order 20, with terminal events at contact changes.

All constants of an expression are runtime parameters, so that each thread compiles an expression
only once for all models and tunings with the same structure.
"""

import threading
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, NO_CONTACT
from gearlib.engines.taylor.series import damping_coefficients
from gearlib.integrators.method import Integrator, Package, option
from gearlib.integrators.right_hand_sides import (
    COAST_FLANK,
    DRIVE_FLANK,
    OneDegree,
    PiecewiseLinear,
    right_hand_side,
)
from gearlib.integrators.run import Run
from gearlib.integrators.split import Arc, Branch, SolverFailure, SplitRun
from gearlib.parameters import Positive


class Heyoka(Integrator):
    """The Taylor integrator of the package heyoka."""

    PACKAGE = Package("heyoka", "heyoka")
    #: The order depends on the tolerance; this is the order at the default tolerance.
    ORDER = 20
    EVENTS = "steps end at switches; contact is a terminal event of the Taylor polynomial"
    MODELS = "one or six degrees of freedom, gear trains; no tooth pairs"
    OPTIONS = {
        "tol": option(
            2.2e-16, Positive, "relative error of a step; by default as small as rounding"
        )
    }

    def supports(self, model) -> bool:
        """Return whether the model has an equation or is a gear train; tooth pairs have neither."""
        return model.equation is not None or model.train is not None

    def create_run(self, model, tuning: float, tol: float) -> Run:
        """Return the `Run` of a model at one tuning (mesh frequency / natural frequency).

        `tol` is the relative tolerance of a step.
        """
        # Only models with one degree of freedom have an `equation`.
        run_class = _TrainRun if model.equation is None else _OneDegreeRun
        return run_class(right_hand_side(model, tuning), tol=tol)


class _Compiled(NamedTuple):
    """Compiled integrator of heyoka, with views of its state and its runtime parameters."""

    integrator: Any
    state: np.ndarray
    parameters: np.ndarray


class _Equations(NamedTuple):
    """Compiled integrator with the parameter values of a branch."""

    compiled: _Compiled
    parameter_values: np.ndarray
    flanks: list[tuple]  #: (mesh, flank) of each flank event


@lru_cache(maxsize=64)
def _compile_for_thread(thread, equations: tuple, events: tuple, tolerance: float) -> _Compiled:
    """Return a compiled integrator for exclusive use by the thread with the identifier `thread`.

    Because of the cache, each thread compiles the same equations only once. `equations` are pairs
    (variable, expression of its derivative). `events` are pairs (expression, direction); a zero of
    the expression stops the integrator if its derivative there has the sign `direction` (1, -1, or
    0 for any). `tolerance` is the relative error of a step.
    """
    import heyoka as hy

    event_directions = (
        hy.event_direction.any,
        hy.event_direction.positive,
        hy.event_direction.negative,
    )
    # The cooldown is the time during which an event is not detected again. The automatic cooldown
    # would be infinite if the run starts at rest with the flanks just touching.
    terminal_events = [
        hy.t_event(expression, direction=event_directions[direction], cooldown=0.0)
        for expression, direction in events
    ]
    state = [0.0] * len(equations)
    integrator = hy.taylor_adaptive(list(equations), state, t_events=terminal_events, tol=tolerance)
    return _Compiled(integrator, integrator.state, integrator.pars)


class _HeyokaRun(SplitRun):
    """Run by compiled integrators, which are restarted for each arc."""

    def compiled_equations(self, branch: Branch, state: np.ndarray) -> _Equations:
        """Return the compiled equations of a branch for an arc that starts from a state."""
        raise NotImplementedError

    def compile(self, equations: list[tuple], events: list[tuple]) -> _Compiled:
        """Return the compiled integrator of this thread; see `_compile_for_thread`."""
        thread, tolerance = threading.get_ident(), self.solver_options["tol"]
        return _compile_for_thread(thread, tuple(equations), tuple(events), tolerance)

    def solve(self, branch: Branch, state: np.ndarray) -> Arc:
        """Return the `Arc` from a state to a flank crossing or to the end of a branch.

        A branch is an interval of phase with constant contact on one stiffness segment, and an arc
        is the solution on it. Raise `SolverFailure` if the solver fails.
        """
        from heyoka import taylor_outcome

        (integrator, state_view, parameters), values, flanks = self.compiled_equations(
            branch, state
        )
        # The view contains only parameters that occur in an expression.
        parameters[:], state_view[:] = values[: parameters.size], state
        integrator.time = branch.start
        outcome, _, _, steps, interpolate, _ = integrator.propagate_until(
            branch.end, c_output=self.is_recording
        )
        self.evaluations += steps * integrator.order
        t, end_state, crossing = branch.end, state_view.copy(), None
        if outcome != taylor_outcome.time_limit:
            # The outcome is -1 - i if event i has stopped the integrator. The flank events are
            # followed by at most one other event; any other outcome is a failure.
            t, event = integrator.time, -1 - int(outcome)
            if not 0 <= event <= len(flanks):
                raise SolverFailure
            if event < len(flanks):
                crossing = self._identify_crossing(branch, t, end_state, *flanks[event])
            else:
                # The event is a sign change of the velocity.
                end_state[1] = 0.0
        if not self.is_recording or interpolate is None:
            # An arc without steps has a single state.
            def constant_state(phases):
                return np.repeat([end_state], len(phases), axis=0)

            times, states = np.array([branch.start, t]), np.array([state, end_state])
            return Arc(times, states, crossing, constant_state)
        times = np.array(interpolate.times)
        states = interpolate(times)
        times[-1], states[-1] = t, end_state
        return Arc(times, states, crossing, interpolate)

    def _identify_crossing(
        self, branch: Branch, t: float, state, mesh: int, flank: int
    ) -> int | None:
        """Return the index in `branch.crossings` of the crossing at which an arc has stopped.

        The arc ends in `state` at the mesh phase t, counted from the start of the mesh period,
        where the distance of the mesh from the flank is zero. `mesh` is the index of the mesh, and
        `flank` is DRIVE_FLANK or COAST_FLANK. If the motion only grazes the flank, move the state
        away from the flank and return None, because the contact does not change.
        """
        phase = branch.period_start + t
        rate = self.problem.flank_distance_rates(phase, state)[flank][mesh]
        for i, crossing in enumerate(branch.crossings):
            if (crossing.mesh, crossing.flank) == (mesh, flank):
                if crossing.direction * rate > 0.0:
                    return i
                # The motion only grazes the flank, so it restarts on its previous side.
                rate = -crossing.direction
        distance = self.restart_distance(state) * (1.0 if rate > 0.0 else -1.0)
        self.problem.set_distance(phase, state, mesh, flank, distance)
        return None


class _OneDegreeRun(_HeyokaRun):
    """Run with one degree of freedom and an integrator per contact state and sign of dx/dtau."""

    problem: OneDegree
    #: Just above the rounding error of a displacement near the coast flank.
    RESTART_DISTANCE = 1e-15

    def __init__(self, problem: OneDegree, tol: float):
        """Store the right-hand side and the relative tolerance of a step."""
        super().__init__(problem, tol=tol)
        self._branches: dict = {}

    def compiled_equations(self, branch: Branch, state: np.ndarray) -> _Equations:
        """Return the compiled equations of a branch for an arc from the state (x, x').

        A branch is an interval of phase with constant contact on one stiffness segment. With
        quadratic damping the equations depend on the sign of the velocity. Equations are cached and
        reused.
        """
        contact_state, velocity_sign = int(branch.contact_states[0]), 0
        _, quadratic_damping, _ = damping_coefficients(self.problem.mesh, contact_state)
        if quadratic_damping != 0.0:
            v = state[1]
            # At rest the acceleration determines the sign of the velocity just afterwards.
            if v == 0.0:
                v = self.problem.branch_derivative(
                    branch.start, state, branch.segment, branch.contact_states
                )[1]
            velocity_sign = 1 if v >= 0.0 else -1
        arguments = branch.segment, contact_state, velocity_sign
        if arguments not in self._branches:
            self._branches[arguments] = self._build_equations(*arguments, branch.crossings)
        return self._branches[arguments]

    def _build_equations(self, segment: int, contact_state, velocity_sign, crossings) -> _Equations:
        """Return compiled equations for a stiffness segment, a contact state and a sign of x'.

        The contact state is 1 on the drive flank, 0 without contact, -1 on the coast flank. Each
        `FlankCrossing` in `crossings` is an event. The sign is 0 without quadratic damping; with
        it, x' = 0 is an event as well, because |x'| is not smooth there.
        """
        import heyoka as hy

        mesh, parameter_values = self.problem.mesh, []
        # Displacements at which the drive flank and the coast flank begin to touch.
        contact_displacements = mesh.drive_line, mesh.coast_line
        x, v = hy.make_vars("x", "v")

        def parameter(value):
            """Add a runtime parameter with the given value to the integrator and return it."""
            parameter_values.append(value)
            return hy.par[len(parameter_values) - 1]

        def harmonic_sum(harmonics):
            """Return the expression of a Fourier series in the mesh phase, the time of heyoka.

            `harmonics` has rows (order, cosine coefficient, sine coefficient).
            """
            terms = []
            for order, cosine, sine in harmonics.tolist():
                terms.append(parameter(cosine) * hy.cos(order * hy.time))
                terms.append(parameter(sine) * hy.sin(order * hy.time))
            return hy.sum(terms)

        # These are the coefficients of v, |v| v and v^3.
        d1, d2, d3 = damping_coefficients(mesh, contact_state)
        damping = parameter(d1) + parameter(-d2 if velocity_sign < 0 else d2) * v
        damping = damping + parameter(d3) * v * v
        force = harmonic_sum(mesh.force_harmonics) - damping * v
        force = force - parameter(mesh.ground_stiffness) * x
        if contact_state != NO_CONTACT:
            segments, harmonics, flank = (
                mesh.stiffness_segments,
                mesh.stiffness_harmonics,
                DRIVE_FLANK,
            )
            if contact_state == COAST:
                segments, harmonics = mesh.coast_stiffness_segments, mesh.coast_stiffness_harmonics
                flank = COAST_FLANK
            start_value, slope = segments[segment]
            phase = hy.time - parameter(mesh.segment_bounds[segment])
            stiffness = parameter(start_value) + parameter(slope) * phase + harmonic_sum(harmonics)
            deflection = x - parameter(contact_displacements[flank])
            p2, p3 = mesh.stiffness_powers
            # The contact state is the sign of the deflection, so the first term is p2 |deflection|.
            nonlinearity = parameter(contact_state * p2) + parameter(p3) * deflection
            force -= stiffness * (deflection + nonlinearity * deflection * deflection)
        events = [
            (x - parameter(contact_displacements[crossing.flank]), crossing.direction)
            for crossing in crossings
        ]
        if velocity_sign:
            events.append((v, -velocity_sign))
        flanks = [(crossing.mesh, crossing.flank) for crossing in crossings]
        return _Equations(
            self.compile([(x, v), (v, force)], events), np.array(parameter_values), flanks
        )


class _TrainRun(_HeyokaRun):
    """Run with any number of meshes; the integrator is parametrised by the branch matrix."""

    problem: PiecewiseLinear

    def __init__(self, problem: PiecewiseLinear, tol: float):
        """Compile the equations of a right-hand side; `tol` is the relative tolerance of a step.

        All equations and flank distances are linear in the full state, which contains the
        variables, the constant 1 and the harmonics of the mesh phase. Their nonzero coefficients
        are parameters of the integrator.
        """
        import heyoka as hy

        super().__init__(problem, tol=tol)
        # A mesh with infinite backlash has no coast flank.
        flank_counts = 1 + np.isfinite(problem.backlashes)
        self._flanks = [(j, flank) for j in self.meshes for flank in range(flank_counts[j])]
        # The product of these rows and the full state are the distances from the flanks.
        distance_rows = np.array([problem.distances[flank, j] for j, flank in self._flanks])
        self._nonzero_entries, distance_is_nonzero = problem.nonzero_entries(), distance_rows != 0.0
        # The parameters are the start phase of the mesh period, which `compiled_equations` sets,
        # the nonzero entries of the distance rows, and the nonzero entries of the branch matrix.
        self._values = np.concatenate([[0.0], distance_rows[distance_is_nonzero]])
        variables = hy.make_vars(*(f"z{i}" for i in range(problem.size)))
        phases = [order * (hy.par[0] + hy.time) for order in problem.system.harmonics.tolist()]
        harmonics = [wave(phase) for phase in phases for wave in (hy.cos, hy.sin)]
        full_state, row_products = [*variables, hy.expression(1.0), *harmonics], []
        parameter_count = 1
        for is_nonzero in np.concatenate([distance_is_nonzero, self._nonzero_entries]):
            # Each row of the product is a sum of parameters times components of the full state.
            columns = np.flatnonzero(is_nonzero)
            terms = [
                hy.par[parameter_count + i] * full_state[column] for i, column in enumerate(columns)
            ]
            row_products.append(hy.sum(terms))
            parameter_count += columns.size
        flank_count = len(self._flanks)
        events = [(distance, 0) for distance in row_products[:flank_count]]
        equations = list(zip(variables, row_products[flank_count:], strict=True))
        self._compiled = self.compile(equations, events)

    def compiled_equations(self, branch: Branch, state: np.ndarray) -> _Equations:
        """Return the compiled integrator with the parameters of a branch; the state is not used.

        A branch is an interval of phase with constant contact on one stiffness segment.
        """
        self._values[0] = branch.period_start
        matrix = self.problem.branch_matrix(branch.segment, branch.contact_states)
        values = np.concatenate([self._values, matrix[self._nonzero_entries]])
        return _Equations(self._compiled, values, self._flanks)


METHODS = {"heyoka": Heyoka()}
