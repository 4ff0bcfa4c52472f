"""`certify_range`: an orbit proven at every tuning of a range, with the same contacts throughout.

The range is cut into pieces. On each 1 / nu is a ball that holds them all, and Krawczyk's test,
the signs of the arcs and Jury's conditions hold for every number of the ball. Where two pieces
meet, the orbit is enclosed within the boxes of both, in each of which it is the only one: it is one
branch.
"""

from typing import Any

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcLaws
from gearlib.analysis.proofs.balls import flint, precision
from gearlib.analysis.proofs.certificate_files import Piece, RangeCertificate, Refusal, Uncertain
from gearlib.analysis.proofs.multipliers import UNDECIDED, eigenvalues, verdict
from gearlib.analysis.proofs.orbits import Proof, listed_contacts, pattern_of
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts
from gearlib.runs.run_arguments import check_tuning

_BITS = 128
#: Least radius of a box: far above the rounding of its centre to a float.
_MIN_RADIUS = 1e-12
#: Share of a box in which the test has to end: a second program's enclosures are wider.
_IMAGE_SHARE = 0.8
#: First piece and shortest piece, as shares of the range; how pieces grow; most pieces.
_FIRST, _SHORTEST, _GROWTH, _MAX_PIECES = 1.0 / 32.0, 1e-9, 1.6, 100_000


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
    flint()
    try:
        contacts = listed_contacts(orbit)
        with precision(_BITS):
            return _Range(orbit, *contacts).upto(to)
    except Uncertain as reason:
        return Refusal(*reason.args)


class _Range:
    """The branch of an orbit, piece by piece."""

    def __init__(self, orbit, codes, events):
        if ArcLaws(orbit.pair, orbit.tuning).wave_columns:
            raise Uncertain(
                "model",
                f"over the tuning no {type(orbit.pair).__name__} with harmonics of load, deviation "
                "or run-out is proven",
            )
        self.orbit, self.codes, proof = orbit, codes, Proof(orbit, codes, events)
        self.laws, self.events = proof.laws, proof.contacts()
        if len(proof.box) < self.laws.state_count + len(events):
            raise Uncertain("together", "contacts come together: no range is proven of them")
        #: The orbit at the tuning that is reached: its enclosure, a list of balls.
        self.reached = proof.box

    def path(self, scale):
        """Return the `Path` at a ball of 1 / nu."""
        phases = self.reached[self.laws.state_count :]
        events = [(at, *event[1:]) for at, event in zip(phases, self.events, strict=True)]
        return Path(self.laws, self.codes, events, self.orbit.period, scale)

    def upto(self, to):
        """Return the certificate of the range from the orbit to a tuning."""
        arb, start = flint().arb, float(self.orbit.tuning)
        at, step = start, _FIRST * (to - start)
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
                if abs(step) < _SHORTEST * abs(to - start) or len(pieces) == _MAX_PIECES:
                    status, message = failed.args
                    raise Uncertain(
                        status, f"from nu = {start!r} to {at:.9g} it is proven, there: {message}"
                    ) from None
                continue
            pieces.append(Piece(min(at, end), max(at, end), *box))
            at, step = end, _GROWTH * step
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

    def _piece(self, scale, end, stability_before):
        """Return (stability and reason, enclosure at the end, box as of `Piece`) of a piece."""
        path, n = self.path(scale), self.laws.state_count
        zero, inverse = krawczyk.polish(self.path(scale.mid()).equations, self.reached)
        # As exact floating-point numbers, for a second program.
        middles = [float(value) for value in zero]
        centre = [flint().arb(value) for value in middles]
        residuals, *_ = path.equations(centre)
        steps = [float(abs(step).upper()) for step in krawczyk.times(inverse, residuals)]
        # Wider than the enclosures at both ends, where nothing depends on the tuning too.
        radii = [2.0 * step + max(steps) + _MIN_RADIUS for step in steps]
        shift = krawczyk.image(path.equations, centre, radii, inverse, residuals)
        if not krawczyk.inside(shift, [_IMAGE_SHARE * radius for radius in radii]):
            raise Uncertain(*krawczyk.FOLD)
        box = [m + s for m, s in zip(centre, shift, strict=True)]
        _, rows, arcs, ends = path.equations(box)
        check_contacts(path, arcs, ends, path.phases(box[n:]))
        matrix = path.monodromy(rows)
        stability = verdict(eigenvalues(matrix), matrix, path.determinant(arcs))
        if stability == UNDECIDED or stability_before not in (None, stability):
            change = ", unlike before" if stability_before else ""
            raise Uncertain("stability", stability[1] + change)
        # The whole boxes hold one orbit each: it has to lie in both where they meet.
        wide = [flint().arb(m, r) for m, r in zip(centre, radii, strict=True)]
        system = self.path(end).equations
        next_orbit = krawczyk.enclose(system, *krawczyk.polish(system, centre))
        for enclosure in (self.reached, next_orbit):
            if not all(a.contains_interior(b) for a, b in zip(wide, enclosure, strict=True)):
                raise Uncertain(*krawczyk.FOLD)
        return stability, next_orbit, (tuple(middles), tuple(radii))
