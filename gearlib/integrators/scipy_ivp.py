"""Runs with SciPy's solvers of initial value problems, with or without event location.

With ``events=False`` the whole span is integrated at once, with the same steps as in
`scipy.integrate.solve_ivp`; dense output is stored only where it is recorded. With ``events=True``
`solve_ivp` is restarted at each stiffness switch and, by terminal events, at each contact change.
"""

from functools import partial
from typing import Annotated, Literal

import numpy as np

from gearlib.data import status
from gearlib.integrators.method import ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE, Integrator, option
from gearlib.integrators.right_hand_sides import right_hand_side
from gearlib.integrators.run import MESH_PERIOD, Run, failure_status, is_state_in_range
from gearlib.integrators.split import Arc, Branch, FlankCrossing, SolverFailure, SplitRun
from gearlib.parameters import CHOICE, Boolean, describe_requirement

Solver = Annotated[Literal["RK45", "DOP853", "Radau", "LSODA"], CHOICE]
#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 1_000


class Scipy(Integrator):
    """The solvers of SciPy."""

    EVENTS = "none; with events = True, steps end at switches and contact is a terminal event"
    MODELS = "one or six degrees of freedom, gear trains; no tooth pairs"
    OPTIONS = {
        "solver": option("RK45", Solver, describe_requirement(Solver)),
        "rtol": RELATIVE_TOLERANCE,
        "atol": ABSOLUTE_TOLERANCE,
        "events": option(
            False,
            Boolean,
            "whether runs are split at stiffness switches and at contact changes",
        ),
    }

    def supports(self, model) -> bool:
        """Return whether the model has an equation or is a gear train; tooth pairs have neither."""
        return model.equation is not None or model.train is not None

    def create_run(self, model, tuning: float, solver: str, rtol, atol, events: bool) -> Run:
        """Return the `Run` of a model at one tuning (mesh frequency / natural frequency).

        `solver` is the name of a solver of SciPy; `rtol` and `atol` are the relative and absolute
        tolerances of a step. With `events` the run is split at stiffness switches and contact
        changes.
        """
        run_class = _SplitScipyRun if events else _ScipyRun
        return run_class(right_hand_side(model, tuning), method=solver, rtol=rtol, atol=atol)


class _ScipyRun(Run):
    """Run by a single integration over the whole span, without event location."""

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole run from a state at phase 0; return (final state, status).

        The status is EVENT_LIMIT if a mesh period has more than `max_events` steps. Steps in the
        recorded mesh periods are stored and recorded in batches.
        """
        solver = self._create_solver(state)
        steps_in_period, period, steps = 0, 0, []
        # Strobes are the states at the starts of the last mesh periods.
        if self.first_strobe == 0:
            self.add_strobes(np.array([0]), state[None])
        while solver.status == "running":
            t, start_state = solver.t, solver.y.copy()
            if int(t // MESH_PERIOD) > period:
                period, steps_in_period = int(t // MESH_PERIOD), 0
            if steps_in_period >= self.max_events:
                return start_state, status.EVENT_LIMIT
            steps_in_period += 1
            try:
                solver.step()
            except ValueError:  # numbers overflow within the step
                return start_state, failure_status(start_state)
            if not is_state_in_range(solver.y):
                return solver.y, status.OVERFLOW
            if self.problem.is_jammed(solver.t, solver.y):
                return solver.y, status.JAMMED
            if solver.status == "failed":
                return start_state, status.STALLED
            # Strobes may begin before the recorded periods, to detect whether the motion repeats.
            is_recorded = solver.t > MESH_PERIOD * self.first_recorded
            passes_strobe = solver.t // MESH_PERIOD > max(t // MESH_PERIOD, self.first_strobe - 1)
            if is_recorded or passes_strobe:
                steps.append((t, start_state, solver.dense_output()))
            if steps and (not is_recorded or len(steps) == _STEPS_PER_RECORD):
                self._record_solver_steps(steps, solver)
                steps = []
        if steps:
            self._record_solver_steps(steps, solver)
        return solver.y, status.OK

    def _create_solver(self, state: np.ndarray):
        """Return a SciPy solver that starts from a state at phase 0 and counts evaluations.

        The time of the solver is the mesh phase, up to the end of the last mesh period.
        """
        from scipy import integrate

        def derivative(t, z):
            """Count an evaluation and return the derivative of the state z at the phase t."""
            self.evaluations += 1
            return self.problem.derivative(t, z)

        solver_class = getattr(integrate, self.solver_options["method"])
        tolerances = {"rtol": self.solver_options["rtol"], "atol": self.solver_options["atol"]}
        return solver_class(derivative, 0.0, state, MESH_PERIOD * self.periods, **tolerances)

    def _record_solver_steps(self, steps: list[tuple], solver) -> None:
        """Record consecutive steps of a SciPy solver, up to its current state.

        Each of the `steps` is (start phase, start state, dense output), where the dense output is a
        function that returns states inside the step.
        """
        from scipy.integrate import OdeSolution

        phases = np.array([step[0] for step in steps] + [solver.t])
        states = np.array([step[1] for step in steps] + [solver.y])
        solution = OdeSolution(phases, [step[2] for step in steps])
        # In records, phases are counted from the start of a mesh period.
        period = int(steps[0][0] // MESH_PERIOD)
        start = MESH_PERIOD * period
        self.record_steps(period, phases - start, states, lambda t: solution(t + start).T)


class _SplitScipyRun(SplitRun):
    """Run by `solve_ivp` with terminal events, split at stiffness switches and contact changes."""

    def _flank_distance(self, period_start, crossing: FlankCrossing, t: float, state) -> float:
        """Return the distance of a mesh from a flank, an event function of phase t and state.

        It is zero at the `FlankCrossing` `crossing`. The phase t is counted from `period_start`,
        the phase at the start of the mesh period.
        """
        distances = self.problem.flank_distances(period_start + t, state)
        return distances[crossing.flank][crossing.mesh]

    def solve(self, branch: Branch, state: np.ndarray) -> Arc:
        """Return the `Arc` from a state to a flank crossing or to the end of a branch.

        A branch is an interval of phase with constant contact on one stiffness segment, and an arc
        is the solution on it. Raise `SolverFailure` if the solver fails.
        """
        from scipy.integrate import solve_ivp

        period_start, start, end, segment, contact_states, crossings = branch

        def derivative(t, z):
            """Count an evaluation and return the derivative of the state z on the branch."""
            self.evaluations += 1
            return self.problem.branch_derivative(period_start + t, z, segment, contact_states)

        events = []
        for crossing in crossings:
            event = partial(self._flank_distance, period_start, crossing)
            # `solve_ivp` reads these attributes of an event function.
            vars(event).update(terminal=True, direction=crossing.direction)
            events.append(event)
        # States between step ends are needed only for samples.
        dense_output = self.is_recording and self.sample_count < len(self.samples)
        options = {"dense_output": dense_output, "events": events} | self.solver_options
        try:
            solution = solve_ivp(derivative, (start, end), state, **options)
        except ValueError:  # numbers overflow, or the phase does not advance
            raise SolverFailure from None
        if solution.status < 0:
            raise SolverFailure
        crossing_index = None
        # All events are terminal, so at most one of them has occurred.
        for i, event_times in enumerate(solution.t_events):
            if event_times.size:
                crossing_index = i
                break
        interpolate = None
        if solution.sol is not None:
            interpolate = lambda phases: solution.sol(phases).T  # noqa: E731
        return Arc(solution.t, solution.y.T, crossing_index, interpolate)


METHODS = {"scipy": Scipy()}
