"""`certify` and `certify_range`: proofs that orbits exist, with contacts and stability.

A range of tunings nu is divided into pieces; 1 / nu is a ball that contains all values of a piece.
At the common tuning of two pieces, the boxes of both contain the same orbit and no other.
"""

import itertools
import math
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit, contact_codes_without_events
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcDynamics
from gearlib.analysis.proofs.balls import digits_of, enclosure, flint, identity, precision
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

#: Largest distance between the states of the proven orbit and the candidate, static deflections.
MAX_DISTANCE = 1e-8
#: Guard bits beyond the requested digits, without and with windows (which widen each other), and
#: largest number of precisions that are tried, each double the previous one.
_GUARD_BITS, _WINDOW_GUARD_BITS, _MAX_DOUBLINGS = 64, 320, 3
#: Largest number of attempts with another order of the contact events.
_MAX_ORDERS = 4
#: Largest relative difference of derivatives with ordered contacts and with windows.
_DERIVATIVE_TOLERANCE = 2.0**-32
#: Precision of the proofs of ranges in bits.
_RANGE_BITS = 128
#: Smallest radius of a box, far above the rounding error of its centre as a float.
_MIN_RADIUS = 1e-12
#: Largest size of the image of a box relative to the box; less than 1, because the enclosures of an
#: independent program may be wider.
_MAX_IMAGE_RATIO = 0.8
#: First and shortest piece of a range, relative to the range; ratio of successive pieces.
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
        return _certificate(orbit, simulated_contacts(orbit), digits)
    except ProofFailed as reason:
        return Refusal(*reason.args)


def _certificate(orbit: Any, contacts: tuple, digits: int, guard_bits: int = _GUARD_BITS) -> Any:
    """Prove an orbit and return its certificate with at least `digits` decimal digits.

    `contacts` are (contact states at tau = 0, contact events), a result of `simulated_contacts`. The
    proof starts with the precision of `digits` plus `guard_bits` binary digits, which is doubled if
    the result has too few digits. If contacts nearly coincide, the proof is repeated with more
    guard bits, because enclosing them in common time windows costs digits. Raise `ProofFailed` if
    the proof fails.
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
            return _certificate(orbit, contacts, digits, _WINDOW_GUARD_BITS)
        if reached_digits >= digits:
            return certificate
        bits *= 2
    raise ProofFailed("precision", f"only {reached_digits} digits were reached, not {digits}")


def simulated_contacts(orbit: Any) -> tuple[list, list]:
    """Simulate an orbit; return (contact states of all meshes at tau = 0, contact events).

    A contact state is 1 for drive-side contact, 0 for no contact, -1 for coast-side contact. Events
    are (phase since tau = 0 in rad, index of the mesh, code before, code after). Raise
    `ProofFailed` if the simulated motion does not have the contact pattern of the orbit, or if
    proofs do not support its model.
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
    lowest, highest = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    codes = contact_codes_without_events(lowest, highest, *model.flank_lines)
    pattern = pattern_of(codes, events)
    # A mesh with events starts with the code before its first event, which comes last here.
    for _, mesh, before, _ in reversed(events):
        codes[mesh] = before
    if pattern != tuple(orbit.pattern):
        text = f"has the contacts {pattern}, not the listed {tuple(orbit.pattern)}"
        raise ProofFailed("contacts", f"the motion from the candidate {text}")
    return codes, events


def pattern_of(codes: list, events: list[tuple]) -> tuple:
    """Return the contact pattern of an orbit, a tuple of contact states.

    A code is 1 for drive-side contact, 0 for no contact, -1 for coast-side contact. `events` are
    (phase, mesh, code before, code after, ...). The pattern has the code before the first event and
    the code after each event. Without events it is `codes`, one for each mesh.
    """
    if not events:
        return tuple(codes)
    return (events[0][2], *(event[3] for event in events))


class Proof:
    """Proof of an orbit at a single tuning, at the current precision of ball arithmetic."""

    def __init__(self, orbit, codes: list, events: list[tuple]):
        """Prove that an orbit exists, with its contact events, or raise `ProofFailed`.

        `orbit` is the candidate, an `Orbit`. `codes` are the contact states of all meshes at tau = 0
        (1 drive side, 0 none, -1 coast side), and `events` the contact events of
        `simulated_contacts`.
        """
        self.orbit, self.codes = orbit, tuple(codes)
        self.dynamics = dynamics = ArcDynamics(orbit.model, orbit.tuning)
        if orbit.period % dynamics.excitation_period:
            text = f"{dynamics.excitation_period} mesh periods, not after {orbit.period}"
            raise ProofFailed("period", f"the excitation repeats after {text}")
        candidate, n = dynamics.initial_state(orbit.state), dynamics.state_count
        centre, inverse = self._newton_solution(candidate, events)
        system = self.path.equations
        windows = Windows(self.path, centre[n:])
        if windows.are_needed():
            system = windows.equations
            self._check_derivative(windows, centre)
            centre, inverse = krawczyk.polish(system, centre[:n])
        #: Enclosures of the state at tau = 0 and, without windows (time intervals around nearly
        #: coincident contacts), of the phases of the contacts.
        self.box = krawczyk.enclose(system, centre, inverse)
        # The box, a list of balls (intervals), has the phases of the contacts after the state.
        differences = [value - ball for ball, value in zip(self.box, candidate, strict=False)]
        self.distance = max(abs(difference).upper() for difference in differences)
        if not self.distance < MAX_DISTANCE:
            distance = f"{float(self.distance):.2g} static deflections from the candidate"
            text = f"the nearest orbit found lies {distance}; {MAX_DISTANCE:g} is allowed"
            raise ProofFailed("distance", text)
        # `ends` are the modal states at the nodes, by index, and `speeds` the rates of the flank
        # distances at the contact events.
        if windows.are_needed():
            results = windows.propagate(self.box, check_arcs=True)
            _, rows, self.phases, self.speeds, self.ends = results
            # `map` is the monodromy matrix.
            self.map, self.determinant = flint().arb_mat(rows), None
        else:
            self.phases = self.box[n:]
            _, rows, self.arcs, self.ends = system(self.box)
            self.speeds = check_contacts(self.path, self.arcs, self.ends, self.phases)
            self.map, self.determinant = self.path.monodromy(rows), self.path.determinant(self.arcs)
        # An orbit that may repeat earlier does not have the claimed smallest period.
        period = orbit.period
        for count, node in enumerate(self.path.period_ends, start=1):
            shorter = count * dynamics.excitation_period
            end = (dynamics.basis * self.ends[node]).entries()[:n]
            if period % shorter == 0 and all(map(flint().arb.overlaps, end, self.box)):
                plural = "s" if shorter > 1 else ""
                text = f"{shorter} mesh period{plural} already, not after {period}"
                raise ProofFailed("period", f"it repeats after {text}")
        self.radius = krawczyk.uniqueness_radius(system, centre, inverse)

    def _check_derivative(self, windows: Windows, centre: list) -> None:
        """Raise `ProofFailed` if the derivatives with windows differ from the ordinary derivatives.

        Windows are time intervals around nearly coincident contact events. `centre` are the state
        and the phases of the contact events, at which the monodromy matrices are compared. Only the
        ordinary derivatives are compared with finite differences, because enclosures with windows
        are too wide for that.
        """
        residuals, rows, *_ = self.path.equations(centre)
        krawczyk.check_derivative(self.path.equations, centre, residuals)
        monodromy, n = self.path.monodromy(rows), self.dynamics.state_count
        _, rows = windows.equations(centre[:n])
        differences = monodromy - identity(n) - flint().arb_mat(rows)
        for difference, entry in zip(differences.entries(), monodromy.entries(), strict=True):
            if not abs(difference).lower() < _DERIVATIVE_TOLERANCE * max(1, abs(entry)):
                raise ProofFailed(*krawczyk.WRONG_DERIVATIVE)

    def _newton_solution(self, state: list, events: list[tuple]) -> tuple[list, Any]:
        """Solve the equations of the orbit by Newton's method, and set `path` to its `Path`.

        `state` is (y, dy/dtheta) of the candidate at tau = 0, displacements and rates, and `events`
        are its contact events. If Newton's method changes the order of their phases, they are
        sorted again and the iteration is repeated. Return (approximate zero of the equations,
        approximate inverse of their Jacobian matrix).
        """
        for _ in range(_MAX_ORDERS):
            self.path = Path(self.dynamics, self.codes, events, self.orbit.period)
            centre, inverse = krawczyk.polish(self.path.equations, state + self.path.initial_phases)
            state, phases = centre[: len(state)], centre[len(state) :]
            # Nearly coincident contact events may have any order.
            differences = [phase - next_phase for phase, next_phase in pairwise(phases)]
            if all(difference < smallest_interval() for difference in differences):
                break
            order = sorted(range(len(phases)), key=lambda i: phases[i])
            events = [(phases[i], *events[i][1:]) for i in order]
        return centre, inverse

    def contacts(self) -> list[tuple]:
        """Return the proven contact events as tuples (phase, mesh, code before, code after, speed).

        The contact states are 1 drive side, 0 none, -1 coast side. The speed is the rate of the
        flank distance by the mesh phase tau; phases and speeds are balls (intervals).
        """
        # The other nodes of the path are switches of the stiffness and the end of the orbit.
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

        def enclosed(value):
            """Convert balls (intervals) in nested sequences to enclosures; add them to `balls`."""
            if isinstance(value, (list, tuple)):
                return tuple(map(enclosed, value))
            if isinstance(value, flint().acb):
                return enclosed((value.real, value.imag))
            balls.append(value)
            return enclosure(value, digits)

        one_degree, contacts = self.dynamics.one_degree, self.contacts()
        events: list = []
        for phase, mesh, before, after, speed in contacts:
            values = enclosed(phase), before, after, enclosed(speed)
            if one_degree:
                events.append(ContactEvent(*values))
            else:
                events.append(MeshEvent(*values, self.dynamics.mesh_names[mesh]))
        # Displacements and rates dq/dtau of all coordinates; the fixed ones are 0.
        q = np.full((2, len(self.dynamics.model.coordinates)), flint().arb(0))
        q[:, self.dynamics.retained] = np.reshape(self.box[: self.dynamics.state_count], (2, -1))
        q[1] *= self.path.inverse_tuning
        state = q[:, 0].tolist() if one_degree else q.tolist()
        displacement, velocity = enclosed(state)
        multipliers = krawczyk.eigenvalues(self.map)
        stability, reason = krawczyk.stability_verdict(multipliers, self.map, self.determinant)
        if one_degree:
            minimum, maximum = extrema(self.path, self.arcs, self.ends)
            other_fields = {
                "pattern": pattern_of(self.codes, contacts),
                "displacement_min": enclosed(minimum),
                "displacement_max": enclosed(maximum),
                "trace": enclosed(self.map.trace()),
                "determinant": enclosed(self.determinant),
            }
        else:
            other_fields = vars(self.dynamics.train_description(self.codes))
        certificate_class = Certificate if one_degree else TrainCertificate
        certificate = certificate_class(
            model=self.orbit.model,
            tuning=float(self.orbit.tuning),
            period=self.orbit.period,
            displacement=displacement,
            velocity=velocity,
            events=tuple(events),
            radius=self.radius,
            moved=float(self.distance),  # distance of the proven orbit from the candidate
            multipliers=enclosed(multipliers),
            stability=stability,
            reason=reason,
            digits=digits,
            **other_fields,
        )
        return certificate, min(map(digits_of, balls))


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
        Seconds after which the call returns the certificate of the range that is proven by then;
        its `missing` is the interval that is not proven, and `complete` is False.

    Returns
    -------
    RangeCertificate or Refusal
        The message of a refusal gives the tuning at which the proof ended: at a grazing, a fold, a
        change of stability, or where a contact event coincides with a switch of the stiffness; or
        it says that nothing was proven within `max_seconds`.

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
        contacts = simulated_contacts(orbit)
        with precision(_RANGE_BITS):
            return _Range(orbit, *contacts).prove_up_to(to, limit)
    except ProofFailed as reason:
        return Refusal(*reason.args)


class _Range:
    """Proof of a branch of orbits over a range of tunings, piece by piece."""

    def __init__(self, orbit, codes: list, events: list[tuple]):
        """Prove the orbit at the start of the range, or raise `ProofFailed`.

        `codes` are the contact states of all meshes at tau = 0 (1 drive side, 0 none, -1 coast
        side), and `events` the contact events of `simulated_contacts`.
        """
        if ArcDynamics(orbit.model, orbit.tuning).harmonic_columns:
            text = "with harmonics of load, deviation or run-out is not supported"
            name = type(orbit.model).__name__
            raise ProofFailed("model", f"a range of tunings of a {name} {text}")
        proof = Proof(orbit, codes, events)
        self.orbit, self.codes = orbit, codes
        self.dynamics, self.events = proof.dynamics, proof.contacts()
        # The box lacks the phases of the contact events if some of them share a time window.
        if len(proof.box) < self.dynamics.state_count + len(events):
            text = "a range of tunings with nearly coincident contacts is not supported"
            raise ProofFailed(COINCIDENT, text)
        #: Enclosure of the orbit at the last proven tuning, a list of balls.
        self.last_orbit = proof.box

    def path(self, inverse_tuning: Any) -> Path:
        """Return the equations of the last proven orbit at other tunings, a `Path`.

        `inverse_tuning` is a ball (interval) that contains 1 / nu of these tunings nu.
        """
        # The unknowns are the state at tau = 0, then the phases of the contact events.
        phases = self.last_orbit[self.dynamics.state_count :]
        events = [(phase, *event[1:]) for phase, event in zip(phases, self.events, strict=True)]
        return Path(self.dynamics, self.codes, events, self.orbit.period, inverse_tuning)

    def prove_up_to(self, to: float, limit: TimeLimit) -> RangeCertificate:
        """Prove the range up to the tuning `to` and return the certificate.

        The range is divided into pieces, intervals of the tuning, which are proven one by one. A
        piece that cannot be proven is halved; after a success the next piece is longer. The
        certificate ends early if the time `limit` is over.
        """
        arb, start = flint().arb, float(self.orbit.tuning)
        tuning, step = start, _FIRST_PIECE * (to - start)
        stability: Any = None
        pieces: list = []
        for _ in limit.iterate(with_progress_bar("attempts", itertools.count())):
            if tuning == to:
                break
            end = tuning + step
            # The tuning increases or decreases, so the sign of the range decides.
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
                    range_text = f"from nu = {start!r} to {tuning:.9g} it is proven, there: "
                    raise ProofFailed(status, range_text + message) from None
                continue
            pieces.append(Piece(min(tuning, end), max(tuning, end), *box))
            tuning, step = end, _PIECE_GROWTH * step
        if not pieces:
            raise ProofFailed("time", "the time of max_seconds ended before anything was proven")
        return RangeCertificate(
            self.orbit.model,
            min(start, tuning),
            max(start, tuning),
            self.orbit.period,
            pattern_of(self.codes, self.events),
            stability=stability[0],
            reason=stability[1],
            pieces=tuple(sorted(pieces, key=lambda piece: piece.start)),
            train=self.dynamics.train_description(self.codes),
            missing=() if tuning == to else ((min(tuning, to), max(tuning, to)),),
        )

    def _prove_piece(self, inverse_tuning: Any, inverse_end: Any, previous_stability: Any) -> tuple:
        """Prove that one orbit exists at each tuning nu of a piece, or raise `ProofFailed`.

        A piece is an interval of the tuning. `inverse_tuning` is a ball (interval) that contains 1
        / nu of the piece, `inverse_end` contains 1 / nu of its end. `previous_stability` is the
        (stability, reason) of the previous piece, or None. Return ((stability, reason), enclosure
        of the orbit at the end of the piece, (centre, radii) of the box of unknowns that contains
        all its orbits).
        """
        path, n = self.path(inverse_tuning), self.dynamics.state_count
        zero, inverse = krawczyk.polish(self.path(inverse_tuning.mid()).equations, self.last_orbit)
        # An independent program can read the exact floats of the centre.
        centre_floats = [float(value) for value in zero]
        centre = list(map(flint().arb, centre_floats))
        residuals, *_ = path.equations(centre)
        newton_step = krawczyk.matrix_vector_product(inverse, residuals)
        steps = [float(abs(step).upper()) for step in newton_step]
        # The box is wider than the enclosures at both ends, even if nothing depends on the tuning.
        radii = [2.0 * step + max(steps) + _MIN_RADIUS for step in steps]
        shift = krawczyk.krawczyk_shift(path.equations, centre, radii, inverse, residuals)
        if not krawczyk.is_inside(shift, [_MAX_IMAGE_RATIO * radius for radius in radii]):
            raise ProofFailed(*krawczyk.FOLD)
        box = [value + ball for value, ball in zip(centre, shift, strict=True)]
        _, rows, arcs, ends = path.equations(box)
        check_contacts(path, arcs, ends, box[n:])
        monodromy, determinant = path.monodromy(rows), path.determinant(arcs)
        multipliers = krawczyk.eigenvalues(monodromy)
        stability = krawczyk.stability_verdict(multipliers, monodromy, determinant)
        if stability == krawczyk.UNDECIDED or previous_stability not in (None, stability):
            change = ", unlike before" if previous_stability else ""
            raise ProofFailed("stability", stability[1] + change)
        # Each box contains one orbit, and the orbit at a common tuning must lie in both boxes.
        full_box = list(map(flint().arb, centre, radii))
        system = self.path(inverse_end).equations
        next_orbit = krawczyk.enclose(system, *krawczyk.polish(system, centre))
        for orbit_at_end in (self.last_orbit, next_orbit):
            if not all(map(flint().arb.contains_interior, full_box, orbit_at_end)):
                raise ProofFailed(*krawczyk.FOLD)
        return stability, next_orbit, (tuple(centre_floats), tuple(radii))
