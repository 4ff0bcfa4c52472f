"""`certify` and `certify_range`: proofs that orbits exist, with contacts and stability.

A range of tunings is cut into pieces, on each of which 1 / nu is a ball that holds them all. Where
two pieces meet, the orbit lies in the boxes of both, in each of which it is the only one.
"""

import math
from itertools import pairwise
from typing import Any

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit, codes_without_events
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcLaws
from gearlib.analysis.proofs.balls import digits_of, enclosure, flint, identity, precision
from gearlib.analysis.proofs.certificate_files import (
    Certificate,
    ContactEvent,
    MeshEvent,
    Piece,
    RangeCertificate,
    Refusal,
    TrainCertificate,
    Uncertain,
)
from gearlib.analysis.proofs.models_in_balls import model_reader
from gearlib.analysis.proofs.path import Path, Windows, smallest_interval
from gearlib.analysis.proofs.signs import check_contacts, extrema
from gearlib.data.status import JAMMED, MESSAGES
from gearlib.engines import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Largest distance of the proven state from the candidate's, in static deflections.
MAX_DISTANCE = 1e-8
#: Bits beyond the requested digits, the same for contacts that come together, because their windows
#: widen one another, and the largest number of doublings of the bits.
_GUARD_BITS, _WINDOW_GUARD_BITS, _MAX_DOUBLINGS = 64, 320, 3
#: Largest number of times that contact events are sorted anew.
_MAX_ORDERS = 4
#: Largest relative difference of derivatives with ordered contacts and through windows.
_DERIVATIVE_TOLERANCE = 2.0**-32
#: Bits in which ranges are proven.
_RANGE_BITS = 128
#: Smallest radius of a box. It is far above the rounding of the centre to a float.
_MIN_RADIUS = 1e-12
#: Share of a box in which its image must lie, since the enclosures of a second program are wider.
_IMAGE_SHARE = 0.8
#: First and shortest piece of a range, as shares of the range; ratio of neighbouring pieces.
_FIRST_PIECE, _MIN_PIECE, _PIECE_GROWTH, _MAX_PIECES = 1.0 / 32.0, 1e-9, 1.6, 100_000


def certify(orbit, digits=30):
    """Prove that a periodic orbit exists, which contacts it has, and whether it is stable.

    Parameters
    ----------
    orbit : Orbit
        The candidate, a result of `gearlib.periodic_orbit`, of a `GearPair`, of another model of
        one degree of freedom with linear phases of contact, of a `SixDegreePair` or a `GearTrain`;
        none of its numbers is trusted.
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    Certificate, TrainCertificate or Refusal
        A certificate has displacement, velocity and events with their enclosures (exact decimals),
        that of a pair the extrema of the displacement too, radius, within which there is no other
        such orbit, trace, determinant and multipliers, stability with its reason; `as_dict` for a
        file. A refusal is false where a truth value is asked for; its status and message name the
        step that failed.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.

    Notes
    -----
    The floating-point numbers of a `GearPair` and the tuning are taken as exact numbers. The proven
    orbit lies within 1e-8 static deflections of the candidate and has its contacts, in its order,
    and no others. Method: Krawczyk's test in ball arithmetic, see the page on proofs.
    """
    check_orbit(orbit)
    digits = checks.integer("digits", digits, 10, 300)
    flint()
    try:
        return _certificate(orbit, listed_contacts(orbit), digits)
    except Uncertain as reason:
        return Refusal(*reason.args)


def _certificate(orbit: Any, contacts: tuple, digits: int, guard_bits: int = _GUARD_BITS) -> Any:
    """Return the certificate of an orbit; double the precision until enclosures have the digits.

    `contacts` are those of `listed_contacts`. The first precision has guard bits beyond the digits.
    """
    bits, reached = math.ceil(digits / math.log10(2.0)) + guard_bits, 0
    for _ in range(_MAX_DOUBLINGS):
        try:
            with precision(bits):
                certificate, reached = Proof(orbit, *contacts).certificate(digits)
        except Uncertain as reason:
            if reason.args[0] != "together" or guard_bits == _WINDOW_GUARD_BITS:
                raise
            return _certificate(orbit, contacts, digits, _WINDOW_GUARD_BITS)
        if reached >= digits:
            return certificate
        bits *= 2
    raise Uncertain("precision", f"only {reached} digits were reached, not {digits}")


def listed_contacts(orbit: Any) -> tuple[list, list]:
    """Return (contact codes of all meshes at tau = 0, events) of the motion from a candidate.

    Events are (phase from tau = 0, mesh, code before, code after). `Uncertain` is raised if the
    motion does not have the contacts of the candidate orbit.
    """
    model, state, period = orbit.pair, orbit.state, orbit.period
    model_reader(model)
    record = model.propagator(orbit.tuning).record(state, period, MAX_EVENTS)
    if record.status == JAMMED:
        raise Uncertain("jammed", MESSAGES[JAMMED])
    events = [
        (
            2.0 * math.pi * row[columns.EVENT_PERIOD] + row[columns.EVENT_PHASE],
            # Events of several meshes have one more column, the mesh.
            int(row[columns.EVENT_COLUMNS]) if len(row) > columns.EVENT_COLUMNS else 0,
            int(row[columns.EVENT_FROM]),
            int(row[columns.EVENT_TO]),
        )
        for row in record.events
    ]
    summary = record.summary
    lowest, highest = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    codes = codes_without_events(lowest, highest, *model.flank_lines)
    pattern = pattern_of(codes, events)
    for _, mesh, before, _ in reversed(events):
        codes[mesh] = before
    if pattern != tuple(orbit.pattern):
        text = f"has the contacts {pattern}, not the listed {tuple(orbit.pattern)}"
        raise Uncertain("contacts", f"the motion from the candidate {text}")
    return codes, events


def pattern_of(codes: list, events: list[tuple]) -> tuple:
    """Return contact codes in the order in which they occur, those of all meshes without events.

    Events are (phase, mesh, code before, code after, ...).
    """
    return (events[0][2], *(event[3] for event in events)) if events else tuple(codes)


class Proof:
    """The proof of one orbit at the current precision of ball arithmetic."""

    def __init__(self, orbit, codes: list, events: list[tuple]):
        """Prove a candidate orbit with its contact codes at tau = 0 and its contact events.

        Events are (phase, mesh, code before, code after). `Uncertain` is raised if a step fails.
        """
        self.orbit, self.codes = orbit, tuple(codes)
        self.laws = laws = ArcLaws(orbit.pair, orbit.tuning)
        if orbit.period % laws.common_period:
            text = f"{laws.common_period} mesh periods, not after {orbit.period}"
            raise Uncertain("period", f"the excitation repeats after {text}")
        candidate, n = laws.initial_state(orbit.state), laws.state_count
        centre, inverse = self._polished(candidate, events)
        system = self.path.equations
        windows = Windows(self.path, centre[n:])
        if windows.any():
            system = windows.equations
            self._check_derivative(windows, centre)
            centre, inverse = krawczyk.polish(system, centre[:n])
        #: Enclosure of the state at tau = 0, and of the contacts' phases where there is no window.
        self.box = krawczyk.enclose(system, centre, inverse)
        self.distance = max(abs(a - b).upper() for a, b in zip(self.box, candidate, strict=False))
        if not self.distance < MAX_DISTANCE:
            text = f"{float(self.distance):.2g} static deflections from the candidate"
            text = f"the nearest orbit found lies {text}; {MAX_DISTANCE:g} is allowed"
            raise Uncertain("distance", text)
        if windows.any():
            _, rows, self.phases, self.speeds, self.ends = windows.run(self.box, prove=True)
            self.map, self.determinant = flint().arb_mat(rows), None
        else:
            self.phases = self.box[n:]
            _, rows, self.arcs, self.ends = system(self.box)
            self.speeds = check_contacts(self.path, self.arcs, self.ends, self.phases)
            self.map, self.determinant = self.path.monodromy(rows), self.path.determinant(self.arcs)
        self._check_period()
        self.radius = krawczyk.uniqueness_radius(system, centre, inverse)

    def _check_derivative(self, windows: Windows, centre: list) -> None:
        """Compare the derivative through windows with that of the path at a zero of its equations.

        `Uncertain` is raised if they differ. Enclosures through windows are too wide for a
        comparison with differences.
        """
        residuals, rows, *_ = self.path.equations(centre)
        krawczyk.check_derivative(self.path.equations, centre, residuals)
        ordered, n = self.path.monodromy(rows), self.laws.state_count
        _, rows = windows.equations(centre[:n])
        differences = ordered - identity(n) - flint().arb_mat(rows)
        for difference, entry in zip(differences.entries(), ordered.entries(), strict=True):
            if not abs(difference).lower() < _DERIVATIVE_TOLERANCE * max(1, abs(entry)):
                raise Uncertain(*krawczyk.WRONG_DERIVATIVE)

    def _polished(self, state: list, events: list[tuple]) -> tuple[list, Any]:
        """Return (zero of the orbit equations, inverse of the derivative), with a matching path.

        Newton's method starts at a state and contact events, which are sorted anew if their phases
        change places.
        """
        for _ in range(_MAX_ORDERS):
            self.path = Path(self.laws, self.codes, events, self.orbit.period)
            centre, inverse = krawczyk.polish(self.path.equations, [*state, *self.path.guess])
            state, phases = centre[: len(state)], centre[len(state) :]
            # Contact events that coincide have no order.
            if all(first - second < smallest_interval() for first, second in pairwise(phases)):
                break
            order = sorted(range(len(phases)), key=phases.__getitem__)
            events = [(phases[i], *events[i][1:]) for i in order]
        return centre, inverse

    def _check_period(self) -> None:
        """Raise `Uncertain` if the state may return to its start before the end of the period."""
        period, n = self.orbit.period, self.laws.state_count
        for count, node in enumerate(self.path.period_ends, start=1):
            part = count * self.laws.common_period
            end = (self.laws.basis * self.ends[node]).entries()[:n]
            if period % part == 0 and all(map(flint().arb.overlaps, end, self.box)):
                text = f"{part} mesh period{'s' * (part > 1)} already, not after {period}"
                raise Uncertain("period", f"it repeats after {text}")

    def contacts(self) -> list[tuple]:
        """Return contact events (phase, mesh, code before, code after, distance rate by tau)."""
        contacts = [node for node in self.path.nodes if node.phase is None]
        return [
            (phase, node.mesh, node.before, node.after, speed * self.path.scale)
            for node, phase, speed in zip(contacts, self.phases, self.speeds, strict=True)
        ]

    def certificate(self, digits: int) -> tuple[Certificate | TrainCertificate, int]:
        """Return (certificate with rounded enclosures, decimal digits that the enclosures have)."""
        balls: list = []

        def enclosed(value):
            """Return the enclosures of balls in nested sequences, and remember the balls."""
            if isinstance(value, (list, tuple)):
                return tuple(map(enclosed, value))
            if isinstance(value, flint().acb):
                return enclosed((value.real, value.imag))
            balls.append(value)
            return enclosure(value, digits)

        one_degree, contacts, events = self.laws.one_degree, self.contacts(), []
        for phase, mesh, before, after, speed in contacts:
            values = enclosed(phase), before, after, enclosed(speed)
            name = self.laws.mesh_names[mesh]
            events.append(ContactEvent(*values) if one_degree else MeshEvent(*values, name))
        state = self.laws.all_coordinates(self.box, self.path.scale)
        displacement, velocity = enclosed([half[0] for half in state] if one_degree else state)
        multipliers = krawczyk.eigenvalues(self.map)
        stability, reason = krawczyk.verdict(multipliers, self.map, self.determinant)
        if one_degree:
            smallest, largest = extrema(self.path, self.arcs, self.ends)
            facts = {
                "pattern": pattern_of(self.codes, contacts),
                "displacement_min": enclosed(smallest),
                "displacement_max": enclosed(largest),
                "trace": enclosed(self.map.trace()),
                "determinant": enclosed(self.determinant),
            }
        else:
            facts = vars(self.laws.train_facts(self.codes))
        certificate = (Certificate if one_degree else TrainCertificate)(
            pair=self.orbit.pair,
            tuning=float(self.orbit.tuning),
            period=self.orbit.period,
            displacement=displacement,
            velocity=velocity,
            events=tuple(events),
            radius=self.radius,
            moved=float(self.distance),
            multipliers=enclosed(multipliers),
            stability=stability,
            reason=reason,
            digits=digits,
            **facts,
        )
        return certificate, min(map(digits_of, balls))


def certify_range(orbit, *, to):
    """Prove that an orbit exists at every tuning up to another one, with the same contacts.

    Parameters
    ----------
    orbit : Orbit
        A result of `gearlib.periodic_orbit`, of a model that `gearlib.certify` takes, without
        harmonics of load, deviation or run-out; none of its numbers is trusted.
    to : float
        Tuning at which the range ends, above or below that of the orbit.

    Returns
    -------
    RangeCertificate or Refusal
        A refusal says at which tuning the proof ended, because the orbit grazes, its branch turns
        round, its stability changes, or a contact meets a switch.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.
    """
    check_orbit(orbit)
    to = check_tuning("to", to)
    if to == orbit.tuning:
        checks.number("to", to, "another tuning than that of the orbit", lambda nu: False)
    flint()
    try:
        contacts = listed_contacts(orbit)
        with precision(_RANGE_BITS):
            return _Range(orbit, *contacts).prove_up_to(to)
    except Uncertain as reason:
        return Refusal(*reason.args)


class _Range:
    """The proof of a branch over a range of tunings, piece by piece."""

    def __init__(self, orbit, codes: list, events: list[tuple]):
        """Prove the orbit, with contact codes at tau = 0 and contact events, at its own tuning."""
        if ArcLaws(orbit.pair, orbit.tuning).wave_columns:
            name = type(orbit.pair).__name__
            text = "with harmonics of load, deviation or run-out is proven"
            raise Uncertain("model", f"over the tuning no {name} {text}")
        self.orbit, self.codes, proof = orbit, codes, Proof(orbit, codes, events)
        self.laws, self.events = proof.laws, proof.contacts()
        if len(proof.box) < self.laws.state_count + len(events):
            raise Uncertain("together", "contacts come together: no range is proven of them")
        #: Enclosure of the orbit at the tuning that is reached so far, a list of balls.
        self.reached = proof.box

    def path(self, scale: Any) -> Path:
        """Return the path of the reached orbit for a ball `scale` of 1 / nu."""
        phases = self.reached[self.laws.state_count :]
        events = [(phase, *event[1:]) for phase, event in zip(phases, self.events, strict=True)]
        return Path(self.laws, self.codes, events, self.orbit.period, scale)

    def prove_up_to(self, to: float) -> RangeCertificate:
        """Prove all pieces of the range from the orbit to a tuning; return the certificate."""
        arb, start = flint().arb, float(self.orbit.tuning)
        at, step = start, _FIRST_PIECE * (to - start)
        stability: Any = None
        pieces: list = []
        while at != to:
            end = at + step
            if (end - to) * (to - start) >= 0.0:
                end = to
            scale = (1 / arb(at)).union(1 / arb(end))
            try:
                stability, self.reached, box = self._piece(scale, 1 / arb(end), stability)
            except Uncertain as failed:
                step *= 0.5
                if abs(step) < _MIN_PIECE * abs(to - start) or len(pieces) == _MAX_PIECES:
                    status, message = failed.args
                    proven = f"from nu = {start!r} to {at:.9g} it is proven, there: "
                    raise Uncertain(status, proven + message) from None
                continue
            pieces.append(Piece(min(at, end), max(at, end), *box))
            at, step = end, _PIECE_GROWTH * step
        return RangeCertificate(
            self.orbit.pair,
            min(start, to),
            max(start, to),
            self.orbit.period,
            pattern_of(self.codes, self.events),
            stability[0],
            stability[1],
            tuple(sorted(pieces, key=lambda piece: piece.start)),
            self.laws.train_facts(self.codes),
        )

    def _piece(self, scale: Any, end: Any, stability_before: tuple | None) -> tuple:
        """Prove a piece; return ((stability, reason), enclosure at its end, (centre, radii)).

        The ball `scale` holds 1 / nu of the piece, `end` 1 / nu at its end; the stability must be
        that of the pieces before.
        """
        path, n = self.path(scale), self.laws.state_count
        zero, inverse = krawczyk.polish(self.path(scale.mid()).equations, self.reached)
        # The centre is given in exact floats, which a second program can read.
        middles = [float(value) for value in zero]
        centre = list(map(flint().arb, middles))
        residuals, *_ = path.equations(centre)
        steps = [float(abs(step).upper()) for step in krawczyk.times(inverse, residuals)]
        # The box is wider than the enclosures at both ends, even if nothing depends on the tuning.
        radii = [2.0 * step + max(steps) + _MIN_RADIUS for step in steps]
        shift = krawczyk.image(path.equations, centre, radii, inverse, residuals)
        if not krawczyk.is_inside(shift, [_IMAGE_SHARE * radius for radius in radii]):
            raise Uncertain(*krawczyk.FOLD)
        box = [m + s for m, s in zip(centre, shift, strict=True)]
        _, rows, arcs, ends = path.equations(box)
        check_contacts(path, arcs, ends, box[n:])
        matrix = path.monodromy(rows)
        stability = krawczyk.verdict(krawczyk.eigenvalues(matrix), matrix, path.determinant(arcs))
        if stability == krawczyk.UNDECIDED or stability_before not in (None, stability):
            change = ", unlike before" if stability_before else ""
            raise Uncertain("stability", stability[1] + change)
        # Each box holds one orbit. Where two pieces meet, the orbit has to lie in both boxes.
        full_box = krawczyk.box_of(centre, radii)
        system = self.path(end).equations
        next_orbit = krawczyk.enclose(system, *krawczyk.polish(system, centre))
        if not all(map(flint().arb.contains_interior, 2 * full_box, self.reached + next_orbit)):
            raise Uncertain(*krawczyk.FOLD)
        return stability, next_orbit, (tuple(middles), tuple(radii))
