"""`certify_range`: an orbit proven at every tuning of a range, with the same contacts throughout.

The range is cut into pieces. On each 1 / nu is a ball that holds them all, and Krawczyk's test,
the signs of the arcs and Jury's conditions hold for every number of the ball. Where two pieces
meet, the orbit is enclosed within the boxes of both, in each of which it is the only one: it is one
branch.
"""

from typing import Any

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit
from gearlib.analysis.proofs import candidate, krawczyk
from gearlib.analysis.proofs.balls import flint, precision
from gearlib.analysis.proofs.certificate_files import Piece, RangeCertificate, Refusal, Uncertain
from gearlib.analysis.proofs.multipliers import UNDECIDED, verdict
from gearlib.analysis.proofs.orbits import FOLD, Proof, pattern_of, train_of
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts
from gearlib.runs.run_arguments import check_tuning

_BITS = 128
#: Least radius of a box: far above the rounding of its centre to a float.
_LEAST = 1e-12
#: Share of a box in which the test has to end: a second program's enclosures are wider.
_ROOM = 0.8
#: First piece and shortest piece, as shares of the range; how pieces grow; most pieces.
_FIRST, _SHORTEST, _GROWTH, _PIECES = 1.0 / 32.0, 1e-9, 1.6, 100_000


def certify_range(orbit, *, to):
    """Prove that an orbit lives on at every tuning up to another one, with the same contacts.

    Parameters
    ----------
    orbit : Orbit
        Of `gearlib.periodic_orbit`, of a model as of `gearlib.certify` without harmonics of load,
        deviation or run-out; nothing it says is believed.
    to : float
        Tuning at which the range ends, above or below that of the orbit.

    Returns
    -------
    RangeCertificate or Refusal
        The refusal says at which tuning the proof came to its end: where the orbit grazes, where
        its branch turns round, where its stability changes, or a contact meets a switch.

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
    try:
        candidate.check_model(orbit.pair)
        with precision(_BITS):
            candidate.laws_over_tunings(orbit.pair, orbit.tuning)
            return _Range(orbit, *candidate.listed_contacts(orbit)).upto(to)
    except Uncertain as reason:
        return Refusal(*reason.args)


class _Range:
    """The branch of an orbit, piece by piece."""

    def __init__(self, orbit, codes, events):
        self.orbit, self.codes, proof = orbit, codes, Proof(orbit, codes, events)
        if len(proof.box) < 2 * len(proof.laws.kept) + len(events):
            raise Uncertain("together", "contacts come together: no range is proven of them")
        self.laws, self.events = proof.laws, proof.contacts()
        self.path = Path(proof.laws, codes, events, orbit.period, framed=False)
        #: The orbit at the tuning that is reached: its enclosure, a list of balls.
        self.here = proof.box

    def system(self, scale):
        """Return the equations at a ball of 1 / nu."""
        return lambda u: self.path.equations(u, scale)

    def upto(self, to):
        """Return the certificate of the range from the orbit to a tuning."""
        arb, start = flint().arb, self.orbit.tuning
        at, step = start, _FIRST * (to - start)
        judged: Any = None
        pieces: list = []
        while at != to:
            end = at + step
            if (end - to) * (to - start) >= 0.0:
                end = to
            scale = (1 / arb(at)).union(1 / arb(end))
            try:
                judged, self.here, box = self._piece(scale, 1 / arb(end), judged)
            except Uncertain as failed:
                step *= 0.5
                if abs(step) < _SHORTEST * abs(to - start) or len(pieces) == _PIECES:
                    status, message = failed.args
                    raise Uncertain(
                        status, f"from nu = {start!r} to {at:.9g} it is proven, there: {message}"
                    ) from None
                continue
            pieces.append(Piece(min(at, end), max(at, end), *box))
            at, step = end, _GROWTH * step
        stability, reason = judged
        return RangeCertificate(
            self.orbit.pair,
            min(start, to),
            max(start, to),
            self.orbit.period,
            pattern_of(self.codes, self.events),
            stability,
            reason,
            tuple(sorted(pieces, key=lambda piece: piece.start)),
            train_of(self.laws, self.codes),
        )

    def _piece(self, scale, end, verdict_before):
        """Return (stability and reason, enclosure at the end, box as of `Piece`) of a piece."""
        system = self.system(scale)
        centre, inverse = krawczyk.polish(self.system(scale.mid()), self.here, FOLD)
        # As exact floating-point numbers, for a second program.
        middles = [float(value) for value in centre]
        centre = [flint().arb(value) for value in middles]
        residuals, _ = system(centre)
        steps = [float(abs(step).upper()) for step in krawczyk.times(inverse, residuals)]
        # Wider than the enclosures at both ends, where nothing depends on the tuning too.
        radii = [2.0 * step + max(steps) + _LEAST for step in steps]
        shift = krawczyk.image(system, centre, radii, inverse, residuals)
        if not krawczyk.inside(shift, [_ROOM * radius for radius in radii]):
            raise Uncertain(*FOLD)
        box = [m + s for m, s in zip(centre, shift, strict=True)]
        arcs, ends = self.path.states(box, scale)
        phases = self.path.phases(box[2 * len(self.laws.kept) :])
        check_contacts(self.path, arcs, ends, phases)
        matrix = self.path.deviations(arcs, ends)
        now = verdict(matrix, self.path.determinant([t for _, t in arcs]))
        if now == UNDECIDED or verdict_before not in (None, now):
            raise Uncertain("stability", f"{now[1]}, unlike before" if verdict_before else now[1])
        # The whole boxes hold one orbit each: it has to lie in both where they meet.
        wide = [flint().arb(m, r) for m, r in zip(centre, radii, strict=True)]
        middle, inverse = krawczyk.polish(self.system(end), centre, FOLD)
        there = krawczyk.enclose(self.system(end), middle, inverse)
        for one in (self.here, there):
            if one is None or not all(
                a.contains_interior(b) for a, b in zip(wide, one, strict=True)
            ):
                raise Uncertain(*FOLD)
        return now, there, (tuple(middles), tuple(radii))
