"""`certify` and `certify_range`: proofs that orbits exist, with contacts and stability.

A range of tunings nu is divided into pieces; on each of them 1 / nu is a ball that contains all
values. At the common tuning of two pieces, both boxes contain the same orbit and no other.
"""

import itertools
import math
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit, contact_states_without_events
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcDynamics
from gearlib.analysis.proofs.balls import flint, identity, precision, reliable_digits, to_decimals
from gearlib.analysis.proofs.certificate_files import (
    COINCIDENT,
    Certificate,
    ContactEvent,
    MeshEvent,
    Piece,
    ProofFailed,
    RangeCertificate,
    Refusal,
    TrainCertificate,
)
from gearlib.analysis.proofs.models_in_balls import ball_model_builder
from gearlib.analysis.proofs.path import Path, Windows, smallest_interval
from gearlib.analysis.proofs.signs import check_contacts, extrema
from gearlib.data.status import JAMMED, MESSAGES
from gearlib.engines import orbit as columns
from gearlib.parameters import INTEGER, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds, Tuning

#: Largest distance of the proven orbit from the candidate, in units of the static deflection.
MAX_DISTANCE = 1e-8
#: Guard bits beyond the requested digits, without and with windows (which widen each other), and
#: largest number of attempts, each with double the precision.
_GUARD_BITS, _WINDOW_GUARD_BITS, _MAX_DOUBLINGS = 64, 320, 3
#: Largest number of attempts with different orders of the contact events.
_MAX_ORDERS = 4
#: Largest relative difference of derivatives without and with windows.
_DERIVATIVE_TOLERANCE = 2.0**-32
#: Precision of the proofs of ranges in bits.
_RANGE_BITS = 128
#: Smallest radius of a box, far above the rounding error of its centre as a float.
_MIN_RADIUS = 1e-12
#: Largest ratio of the image of a box to the box: less than 1, because the enclosures of an
#: independent program may be wider.
_MAX_IMAGE_RATIO = 0.8
#: First and shortest piece of a range, relative to the range; growth factor and largest number of
#: pieces.
_FIRST_PIECE, _MIN_PIECE, _PIECE_GROWTH, _MAX_PIECES = 1.0 / 32.0, 1e-9, 1.6, 100_000


@checked
def certify(orbit, digits: Annotated[int, Ge(10), Le(300), INTEGER] = 30):
    """Prove existence, contact events and stability of a periodic orbit.

    Parameters
    ----------
    orbit : Orbit
        The candidate, a result of `gearlib.periodic_orbit` for a `GearPair`, another piecewise
        linear model with one degree of freedom, a `SixDegreePair` or a `GearTrain`. The proof does
        not rely on any of its numbers.
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    Certificate, TrainCertificate or Refusal
        A certificate has enclosures (exact decimals) of displacement, velocity and events, and for
        one degree of freedom also of extrema, trace and determinant; the multipliers; the radius
        within which there is no other such orbit; the stability with its reason; and a method
        `as_dict` for JSON. A refusal has the truth value False; its status and message name the
        failed step.

    Raises
    ------
    ValueError
        If an argument is wrong; the message gives its name, its value and the allowed range.
    ImportError
        If python-flint is not installed.

    Notes
    -----
    The floating-point numbers of a `GearPair` and the tuning are taken as exact numbers. The proven
    orbit lies within 1e-8 static deflections of the candidate and has the same sequence of contact
    events. Method: Krawczyk's test in ball arithmetic, see the page on proofs.
    """
    check_orbit(orbit)
    flint()
    try:
        return _prove_orbit(orbit, simulate_contacts(orbit), digits)
    except ProofFailed as reason:
        return Refusal(*reason.args)


def _prove_orbit(orbit: Any, contacts: tuple, digits: int, guard_bits: int = _GUARD_BITS) -> Any:
    """Prove an orbit and return its certificate with at least `digits` decimal digits.

    `contacts` are (contact states at tau = 0, contact events), a result of `simulate_contacts`. The
    proof starts at a precision of `digits` decimal digits plus `guard_bits` bits, which is doubled
    if the result has too few digits. If contact events nearly coincide, the proof is repeated with
    more guard bits, because enclosing them in time windows costs digits. Raise `ProofFailed` if the
    proof fails.
    """
    bits = math.ceil(digits / math.log10(2.0)) + guard_bits
    reached_digits = 0
    for _ in range(_MAX_DOUBLINGS):
        try:
            with precision(bits):
                certificate, reached_digits = Proof(orbit, *contacts).certificate(digits)
        except ProofFailed as reason:
            if reason.args[0] != COINCIDENT or guard_bits == _WINDOW_GUARD_BITS:
                raise
            return _prove_orbit(orbit, contacts, digits, _WINDOW_GUARD_BITS)
        if reached_digits >= digits:
            return certificate
        bits *= 2
    raise ProofFailed("precision", f"only {reached_digits} of {digits} digits were reached")


def simulate_contacts(orbit: Any) -> tuple[list, list]:
    """Simulate an orbit; return (contact states of all meshes at tau = 0, contact events).

    A contact state is 1 for drive-side contact, 0 for no contact, -1 for coast-side contact. Events
    are (phase from tau = 0 in rad, mesh index, state before, state after). Raise `ProofFailed` if
    the simulated motion does not have the contact pattern of the orbit, or if proofs do not support
    its model.
    """
    model, state, period = orbit.model, orbit.state, orbit.period
    ball_model_builder(model)  # raises ProofFailed unless proofs support the model
    record = model.propagator(orbit.tuning).record(state, period, MAX_EVENTS)
    if record.status == JAMMED:
        raise ProofFailed("jammed", MESSAGES[JAMMED])
    events = []
    for row in record.events:
        phase = 2.0 * math.pi * row[columns.EVENT_PERIOD] + row[columns.EVENT_PHASE]
        # Events of several meshes have an additional column, the index of the mesh.
        mesh = int(row[columns.EVENT_COLUMNS]) if len(row) > columns.EVENT_COLUMNS else 0
        events.append((phase, mesh, int(row[columns.EVENT_FROM]), int(row[columns.EVENT_TO])))
    summary = record.summary
    x_min, x_max = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    contact_states = contact_states_without_events(x_min, x_max, *model.flank_lines)
    pattern = contact_pattern(contact_states, events)
    # The initial state of a mesh with events is the state before its first event (last in reverse).
    for _, mesh, state_before, _ in reversed(events):
        contact_states[mesh] = state_before
    if pattern != tuple(orbit.pattern):
        text = f"has the contact pattern {pattern} instead of {tuple(orbit.pattern)}"
        raise ProofFailed("contacts", f"the motion from the candidate {text}")
    return contact_states, events


def contact_pattern(contact_states: list, events: list[tuple]) -> tuple:
    """Return the contact pattern of an orbit, a tuple of contact states.

    A state is 1 for drive-side contact, 0 for no contact, -1 for coast-side contact. `events` are
    (phase, mesh, state before, state after, ...). The pattern has the state before the first event
    and the state after each event. Without events it is `contact_states`, one for each mesh.
    """
    if not events:
        return tuple(contact_states)
    _, _, first_state, *_ = events[0]
    return (first_state, *(state_after for _, _, _, state_after, *_ in events))


class Proof:
    """Proof of an orbit at a single tuning, at the current precision of ball arithmetic."""

    def __init__(self, orbit, contact_states: list, events: list[tuple]):
        """Prove that an orbit exists with its contact events, or raise `ProofFailed`.

        `orbit` is the candidate, an `Orbit`. `contact_states` has the contact state of each mesh at
        tau = 0 (1 drive side, 0 no contact, -1 coast side), and `events` are the contact events
        from `simulate_contacts`.
        """
        self.orbit, self.contact_states = orbit, tuple(contact_states)
        self.dynamics = dynamics = ArcDynamics(orbit.model, orbit.tuning)
        if orbit.period % dynamics.excitation_period:
            text = f"the excitation repeats only after {dynamics.excitation_period} mesh periods"
            raise ProofFailed("period", f"{text}: the period must be a multiple of it")
        candidate, n = dynamics.initial_state(orbit.state), dynamics.state_count
        centre, inverse = self._solve_equations(candidate, events)
        system = self.path.equations
        windows = Windows(self.path, centre[n:])
        if windows.are_needed():
            system = windows.equations
            self._check_derivative(windows, centre)
            centre, inverse = krawczyk.refine_zero(system, centre[:n])
        #: Enclosures of the state at tau = 0 and, unless there are windows (time intervals around
        #: nearly coincident events), of the phases of the contact events.
        self.box = krawczyk.enclose_zero(system, centre, inverse)
        # The state comes first in the box, before the phases of the contact events.
        differences = [value - ball for ball, value in zip(self.box, candidate, strict=False)]
        self.distance = max(abs(difference).upper() for difference in differences)
        if not self.distance < MAX_DISTANCE:
            distance = f"{float(self.distance):.2g} static deflections from the candidate"
            text = f"the orbit found lies {distance}, more than {MAX_DISTANCE:g}"
            raise ProofFailed("distance", text)
        # `end_states` are the modal states at the nodes, by node index, and `speeds` the rates of
        # the flank distances at the contact events.
        if windows.are_needed():
            results = windows.propagate(self.box, check_arcs=True)
            _, jacobian_rows, self.phases, self.speeds, self.end_states = results
            self.monodromy, self.determinant = flint().arb_mat(jacobian_rows), None
        else:
            self.phases = self.box[n:]
            _, jacobian_rows, self.arcs, self.end_states = system(self.box)
            self.speeds = check_contacts(self.path, self.arcs, self.end_states, self.phases)
            self.monodromy = self.path.monodromy(jacobian_rows)
            self.determinant = self.path.determinant(self.arcs)
        # The claimed period must be the smallest one.
        period = orbit.period
        for count, node in enumerate(self.path.period_ends, start=1):
            shorter_period = count * dynamics.excitation_period
            end_state = (dynamics.basis * self.end_states[node]).entries()[:n]
            if period % shorter_period == 0 and all(map(flint().arb.overlaps, end_state, self.box)):
                plural = "s" if shorter_period > 1 else ""
                text = f"after {shorter_period} mesh period{plural}, before its period of {period}"
                raise ProofFailed("period", f"the orbit may already repeat {text}")
        self.radius = krawczyk.uniqueness_radius(system, centre, inverse)

    def _check_derivative(self, windows: Windows, centre: list) -> None:
        """Raise `ProofFailed` if the derivatives with windows differ from the ordinary derivatives.

        Windows are time intervals around nearly coincident contact events. `centre` has the state
        and the phases of the contact events, at which the monodromy matrices are compared. Only the
        ordinary derivatives are compared with finite differences, because enclosures with windows
        are too wide for this.
        """
        residuals, jacobian_rows, *_ = self.path.equations(centre)
        krawczyk.check_derivative(self.path.equations, centre, residuals)
        monodromy, n = self.path.monodromy(jacobian_rows), self.dynamics.state_count
        _, jacobian_rows = windows.equations(centre[:n])
        differences = monodromy - identity(n) - flint().arb_mat(jacobian_rows)
        for difference, entry in zip(differences.entries(), monodromy.entries(), strict=True):
            if not abs(difference).lower() < _DERIVATIVE_TOLERANCE * max(1, abs(entry)):
                raise ProofFailed(*krawczyk.WRONG_DERIVATIVE)

    def _solve_equations(self, state: list, events: list[tuple]) -> tuple[list, Any]:
        """Solve the equations of the orbit by Newton's method, and set `path` to its `Path`.

        `state` is (y, dy/dtheta) of the candidate at tau = 0, displacements and rates, and `events`
        are its contact events. If Newton's method changes the order of their phases, they are
        sorted and the iteration is repeated. Return (approximate zero of the equations, approximate
        inverse of their Jacobian matrix).
        """
        for _ in range(_MAX_ORDERS):
            self.path = Path(self.dynamics, self.contact_states, events, self.orbit.period)
            start = state + self.path.initial_phases
            centre, inverse = krawczyk.refine_zero(self.path.equations, start)
            state, phases = centre[: len(state)], centre[len(state) :]
            # Nearly coincident contact events need not be sorted.
            differences = [phase - next_phase for phase, next_phase in pairwise(phases)]
            if all(difference < smallest_interval() for difference in differences):
                break
            order = sorted(range(len(phases)), key=lambda i: phases[i])
            events = [(phases[i], *events[i][1:]) for i in order]
        return centre, inverse

    def contacts(self) -> list[tuple]:
        """Return the proven contact events: (phase, mesh, state before, state after, speed) each.

        The contact states are 1 drive side, 0 no contact, -1 coast side. The speed is the rate of
        the flank distance with respect to the mesh phase tau; phases and speeds are balls
        (intervals).
        """
        # The other nodes are switches of the stiffness and the end of the orbit.
        nodes = [node for node in self.path.nodes if node.is_contact]
        return [
            (phase, node.mesh, node.before, node.after, speed * self.path.inverse_tuning)
            for node, phase, speed in zip(nodes, self.phases, self.speeds, strict=True)
        ]

    def certificate(self, digits: int) -> tuple[Certificate | TrainCertificate, int]:
        """Return (certificate, number of reliable decimal digits of its enclosures).

        The enclosures are rounded outwards to the requested `digits`.
        """
        balls: list = []

        def to_enclosures(value):
            """Convert balls (intervals) in nested sequences to decimals; append them to `balls`."""
            if isinstance(value, (list, tuple)):
                return tuple(map(to_enclosures, value))
            if isinstance(value, flint().acb):
                return to_enclosures((value.real, value.imag))
            balls.append(value)
            return to_decimals(value, digits)

        one_degree, contacts = self.dynamics.has_one_degree_of_freedom, self.contacts()
        events: list = []
        for phase, mesh, before, after, speed in contacts:
            values = to_enclosures(phase), before, after, to_enclosures(speed)
            if one_degree:
                events.append(ContactEvent(*values))
            else:
                events.append(MeshEvent(*values, self.dynamics.mesh_names[mesh]))
        # Displacements and rates dq/dtau of all coordinates; fixed coordinates are 0.
        q = np.full((2, len(self.dynamics.model.coordinates)), flint().arb(0))
        q[:, self.dynamics.retained] = np.reshape(self.box[: self.dynamics.state_count], (2, -1))
        q[1] *= self.path.inverse_tuning
        state = q[:, 0].tolist() if one_degree else q.tolist()
        displacement, velocity = to_enclosures(state)
        multipliers = krawczyk.eigenvalues(self.monodromy)
        stability, reason = krawczyk.stability_verdict(
            multipliers, self.monodromy, self.determinant
        )
        if one_degree:
            minimum, maximum = extrema(self.path, self.arcs, self.end_states)
            other_fields = {
                "pattern": contact_pattern(self.contact_states, contacts),
                "displacement_min": to_enclosures(minimum),
                "displacement_max": to_enclosures(maximum),
                "trace": to_enclosures(self.monodromy.trace()),
                "determinant": to_enclosures(self.determinant),
            }
        else:
            other_fields = vars(self.dynamics.train_description(self.contact_states))
        certificate_class = Certificate if one_degree else TrainCertificate
        certificate = certificate_class(
            model=self.orbit.model,
            tuning=float(self.orbit.tuning),
            period=self.orbit.period,
            displacement=displacement,
            velocity=velocity,
            events=tuple(events),
            radius=self.radius,
            moved=float(self.distance),  # distance from the candidate
            multipliers=to_enclosures(multipliers),
            stability=stability,
            reason=reason,
            digits=digits,
            **other_fields,
        )
        return certificate, min(map(reliable_digits, balls))


@checked
def certify_range(orbit, *, to: Tuning, max_seconds: MaxSeconds = None):
    """Prove that an orbit with the same contacts exists at every tuning of a range.

    Parameters
    ----------
    orbit : Orbit
        A result of `gearlib.periodic_orbit` for a model of `gearlib.certify` without harmonics of
        load, deviation or run-out. The proof does not rely on any of its numbers.
    to : float
        Tuning at the end of the range, above or below the tuning of the orbit.
    max_seconds : float, optional
        Time limit in seconds, after which the certificate covers only the range proven up to then;
        its `missing` is the interval that is not proven, and `complete` is False.

    Returns
    -------
    RangeCertificate or Refusal
        The message of a refusal states the tuning at which the proof ended: at a grazing, a fold, a
        change of stability, or where a contact event coincides with a switch of the stiffness; or
        it states that nothing was proven within `max_seconds`.

    Raises
    ------
    ValueError
        If an argument is wrong; the message gives its name, its value and the allowed range.
    ImportError
        If python-flint is not installed.
    """
    check_orbit(orbit)
    checks.require(to != orbit.tuning, "to", to, "different from the tuning of the orbit")
    limit = TimeLimit(max_seconds)
    flint()
    try:
        contacts = simulate_contacts(orbit)
        with precision(_RANGE_BITS):
            return _RangeProof(orbit, *contacts).prove_up_to(to, limit)
    except ProofFailed as reason:
        return Refusal(*reason.args)


class _RangeProof:
    """Proof of a branch of orbits over a range of tunings, piece by piece."""

    def __init__(self, orbit, contact_states: list, events: list[tuple]):
        """Prove the orbit at the start of the range, or raise `ProofFailed`.

        `contact_states` has the contact state of each mesh at tau = 0 (1 drive side, 0 no contact,
        -1 coast side), and `events` are the contact events from `simulate_contacts`.
        """
        if ArcDynamics(orbit.model, orbit.tuning).harmonic_columns:
            text = "models with harmonics of load, deviation or run-out"
            raise ProofFailed("model", f"ranges of tunings are not supported for {text}")
        proof = Proof(orbit, contact_states, events)
        self.orbit, self.contact_states = orbit, contact_states
        self.dynamics, self.events = proof.dynamics, proof.contacts()
        # The box has no phases of contact events if some of them share a time window.
        if len(proof.box) < self.dynamics.state_count + len(events):
            text = "ranges of tunings are not supported for nearly coincident contact events"
            raise ProofFailed(COINCIDENT, text)
        #: Enclosure of the orbit at the last proven tuning, a list of balls.
        self.last_orbit = proof.box

    def path(self, inverse_tuning: Any) -> Path:
        """Return the `Path` of the last proven orbit, with its equations at other tunings.

        `inverse_tuning` is a ball (interval) that contains 1 / nu of these tunings nu.
        """
        # The unknowns are the state at tau = 0, then the phases of the contact events.
        phases = self.last_orbit[self.dynamics.state_count :]
        events = [(phase, *event[1:]) for phase, event in zip(phases, self.events, strict=True)]
        return Path(self.dynamics, self.contact_states, events, self.orbit.period, inverse_tuning)

    def prove_up_to(self, to: float, limit: TimeLimit) -> RangeCertificate:
        """Prove the range up to the tuning `to` and return the certificate.

        The range is divided into pieces, intervals of the tuning, which are proven one after the
        other. A piece that cannot be proven is halved; after a success the next piece is longer.
        The certificate ends early when the time `limit` is reached.
        """
        arb, start = flint().arb, float(self.orbit.tuning)
        tuning, step = start, _FIRST_PIECE * (to - start)
        stability: Any = None
        pieces: list = []
        for _ in limit.iterate(with_progress_bar("attempts", itertools.count())):
            if tuning == to:
                break
            end = tuning + step
            # The sign of the range tells whether the tuning increases or decreases.
            if (end - to) * (to - start) >= 0.0:
                end = to
            inverse_end = 1 / arb(end)
            inverse_tuning = (1 / arb(tuning)).union(inverse_end)
            try:
                stability, self.last_orbit, box = self._prove_piece(
                    inverse_tuning, inverse_end, stability
                )
            except ProofFailed as failed:
                step *= 0.5
                if abs(step) < _MIN_PIECE * abs(to - start) or len(pieces) == _MAX_PIECES:
                    status, message = failed.args
                    proven = f"the orbit is proven from nu = {start!r} to {tuning:.9g}; beyond it"
                    raise ProofFailed(status, f"{proven}, {message}") from None
                continue
            pieces.append(Piece(min(tuning, end), max(tuning, end), *box))
            tuning, step = end, _PIECE_GROWTH * step
        if not pieces:
            raise ProofFailed("time", "nothing was proven within max_seconds")
        return RangeCertificate(
            self.orbit.model,
            min(start, tuning),
            max(start, tuning),
            self.orbit.period,
            contact_pattern(self.contact_states, self.events),
            stability=stability[0],
            reason=stability[1],
            pieces=tuple(sorted(pieces, key=lambda piece: piece.start)),
            train=self.dynamics.train_description(self.contact_states),
            missing=() if tuning == to else ((min(tuning, to), max(tuning, to)),),
        )

    def _prove_piece(self, inverse_tuning: Any, inverse_end: Any, previous_stability: Any) -> tuple:
        """Prove that one orbit exists at each tuning nu of a piece, or raise `ProofFailed`.

        A piece is an interval of the tuning. `inverse_tuning` is a ball (interval) that contains 1
        / nu on the piece, `inverse_end` contains 1 / nu at its end. `previous_stability` is the
        (stability, reason) of the previous piece, or None. Return ((stability, reason), enclosure
        of the orbit at the end of the piece, (centre, radii) of the box of unknowns that contains
        all its orbits).
        """
        path, n = self.path(inverse_tuning), self.dynamics.state_count
        zero, inverse = krawczyk.refine_zero(
            self.path(inverse_tuning.mid()).equations, self.last_orbit
        )
        # The centre consists of floats, which an independent program can read exactly.
        centre_floats = [float(value) for value in zero]
        centre = list(map(flint().arb, centre_floats))
        residuals, *_ = path.equations(centre)
        newton_step = krawczyk.matrix_vector_product(inverse, residuals)
        steps = [float(abs(step).upper()) for step in newton_step]
        # The box must be wider than the enclosures at both ends, even if nothing depends on the
        # tuning.
        radii = [2.0 * step + max(steps) + _MIN_RADIUS for step in steps]
        shift = krawczyk.krawczyk_shift(path.equations, centre, radii, inverse, residuals)
        if not krawczyk.maps_into_interior(shift, [_MAX_IMAGE_RATIO * radius for radius in radii]):
            raise ProofFailed(*krawczyk.FOLD)
        box = [value + ball for value, ball in zip(centre, shift, strict=True)]
        _, jacobian_rows, arcs, end_states = path.equations(box)
        check_contacts(path, arcs, end_states, box[n:])
        monodromy, determinant = path.monodromy(jacobian_rows), path.determinant(arcs)
        multipliers = krawczyk.eigenvalues(monodromy)
        stability = krawczyk.stability_verdict(multipliers, monodromy, determinant)
        if stability == krawczyk.UNDECIDED or previous_stability not in (None, stability):
            change = ", unlike before" if previous_stability else ""
            raise ProofFailed("stability", stability[1] + change)
        # Each box contains one orbit, and the orbit at a common tuning must lie in both of them.
        test_box = list(map(flint().arb, centre, radii))
        system = self.path(inverse_end).equations
        next_orbit = krawczyk.enclose_zero(system, *krawczyk.refine_zero(system, centre))
        for orbit_at_end in (self.last_orbit, next_orbit):
            if not all(map(flint().arb.contains_interior, test_box, orbit_at_end)):
                raise ProofFailed(*krawczyk.FOLD)
        return stability, next_orbit, (tuple(centre_floats), tuple(radii))
