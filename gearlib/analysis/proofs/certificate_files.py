"""Results of proofs: a `Certificate` with its enclosures, or a `Refusal` with its reason."""

from dataclasses import dataclass
from typing import Any

from gearlib.analysis.proofs.balls import Enclosure
from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL

_CONTACT_NAMES = {NORMAL: "normal mesh", BACKLASH: "backlash", INVERSE: "inverse mesh"}
#: Entries of certificates whose floats are exact numbers.
_EXACT = "tuning", "start", "stop", "derived", "pieces"


@dataclass(frozen=True)
class Refusal:
    """Result of a proof that failed, with the reason; its truth value is false."""

    status: str  #: the step that failed: model, contacts, distance, fold, derivative,
    #: switch, together, grazing, jammed, period, precision or stability
    message: str  #: what failed, in a sentence

    def __bool__(self) -> bool:
        """Return False: the proof failed."""
        return False


class Uncertain(Exception):
    """The error that a step of a proof failed, with the arguments (status, sentence)."""


@dataclass(frozen=True)
class ContactEvent:
    """A contact that is gained or lost."""

    phase: Enclosure  #: mesh phase from tau = 0, rad
    before: int  #: contact code before: 1 normal mesh, 0 backlash, -1 inverse mesh
    after: int
    velocity: Enclosure  #: dx/dtau, in static deflections


@dataclass(frozen=True)
class MeshEvent(ContactEvent):
    """A contact that a mesh of a train gains or loses."""

    mesh: str


class _Claim:
    """A proven statement about a model."""

    claim = ""

    def as_dict(self) -> dict:
        """Return the claim for JSON: enclosures as two decimals, exact floats in hexadecimal."""
        values = dict(vars(self))
        model, train = values.pop("pair"), values.pop("train", None)
        values |= vars(train) if train else {}
        values = {name: plain(value, name in _EXACT) for name, value in values.items()}
        parameters = model.as_dict()
        if model.equation is not None:
            # The teeth of a pair do not enter its equation of motion.
            parameters.pop("teeth", None)
        return {"claim": self.claim, **values, "pair": plain(parameters, True)}

    def __repr__(self) -> str:
        """Return the claim as text: a first line, a line for each fact, and the stability."""
        claim: Any = self
        orbit = f"an orbit of {claim.period} mesh period{'s' * (claim.period > 1)}"
        lines = [f"Proven: {orbit} at {claim._tunings.format(claim)}, {claim.stability}"]
        lines += [f"  {name:<13} {text}" for name, text in claim._facts()]
        return "\n".join([*lines, f"  {claim.stability}: {claim.reason}"])


@dataclass(frozen=True, repr=False, kw_only=True)
class _OrbitClaim(_Claim):
    """A periodic orbit that is proven to exist; see `docs/theory/proofs.md`."""

    pair: Any  #: the model
    tuning: float
    period: int  #: mesh periods of the reference mesh; it does not repeat after fewer
    displacement: Any  #: at tau = 0, `Enclosure`, in static deflections, of a train a tuple
    velocity: Any  #: dx/dtau at tau = 0, the same
    events: tuple  #: all contacts gained and lost, in their order, where it is proven
    radius: float  #: no other orbit with these contacts has state and phases this close
    moved: float  #: largest distance of the state from the candidate, in static deflections
    multipliers: tuple  #: pairs of `Enclosure`, real and imaginary part, the largest first
    stability: str  #: "stable", "unstable" or "undecided"
    reason: str  #: why, in a sentence
    digits: int  #: decimal digits of all enclosures, of numbers below 1 behind the point

    _tunings = "tuning {0.tuning!r}"


@dataclass(frozen=True, repr=False, kw_only=True)
class Certificate(_OrbitClaim):
    """A proven orbit of one degree of freedom; see `docs/theory/proofs.md`."""

    pattern: tuple  #: contact codes in the order met, from tau = 0
    displacement_min: Enclosure  #: smallest displacement of the orbit, in static deflections
    displacement_max: Enclosure
    trace: Enclosure  #: of the map of small deviations over the orbit
    determinant: Enclosure

    claim = "orbit"

    def _facts(self) -> list[tuple]:
        """Return the rows (name, value) of the text of the certificate."""
        return [
            ("displacement", self.displacement),
            ("velocity", self.velocity),
            ("smallest x", self.displacement_min),
            ("largest x", self.displacement_max),
            ("contacts", _contact_names(self.pattern)),
            *(("  phase", event.phase) for event in self.events),
            *(("multiplier", _complex_text(*parts)) for parts in self.multipliers),
            ("the only such orbit", f"within {self.radius:.3g}"),
        ]


@dataclass(frozen=True, kw_only=True)
class TrainFacts:
    """The names of a train's meshes and coordinates: displacement and velocity are tuples."""

    meshes: tuple  #: their names
    contacts: tuple  #: contact code of every mesh at the start
    coordinates: tuple  #: their names
    fixed: tuple  #: names of coordinates that are 0: a free rotation is counted from them
    derived: dict  #: numbers that the library derives from the model; the proof takes them as exact


@dataclass(frozen=True, repr=False, kw_only=True)
class TrainCertificate(_OrbitClaim, TrainFacts):
    """A proven orbit of a train; see `docs/theory/proofs.md`."""

    claim = "train"

    def _facts(self) -> list[tuple]:
        """Return the rows (name, value) of the text of the certificate."""
        start_contacts = ", ".join(
            f"{mesh} in {_CONTACT_NAMES[code]}"
            for mesh, code in zip(self.meshes, self.contacts, strict=True)
        )
        facts = [("at tau = 0", start_contacts)]
        for event in self.events:
            contact = f"{event.phase}  {event.mesh} in {_CONTACT_NAMES[event.after]}"
            facts.append(("  phase", contact))
        multiplier = _complex_text(*self.multipliers[0])
        facts.append(("multiplier", f"{multiplier}, the largest of {len(self.multipliers)}"))
        facts.append(("the only such orbit", f"within {self.radius:.3g}"))
        return facts


@dataclass(frozen=True)
class Piece:
    """A piece of a range of tunings: at each of them the box holds one such orbit."""

    start: float
    stop: float
    centre: tuple  #: x, nu dx/dtau, of a train (y, nu dy/dtau) of the coordinates that are not
    #: fixed, and the phases of contact, exact floats
    radii: tuple  #: of the box about the centre, exact floats


@dataclass(frozen=True, repr=False)
class RangeCertificate(_Claim):
    """An orbit that is proven at every tuning of a range, one branch with the same contacts."""

    pair: Any  #: the model
    start: float  #: the lower tuning, an exact number
    stop: float  #: and the upper one
    period: int  #: mesh periods
    pattern: tuple  #: contact codes in the order met, from tau = 0
    stability: str  #: as of `Certificate`, the same in the whole range
    reason: str
    pieces: tuple  #: of the range, `Piece`, ascending; where two meet the orbit is in both boxes
    train: Any = None  #: `TrainFacts`; None: one degree of freedom

    claim = "range"

    _tunings = "every tuning from {0.start!r} to {0.stop!r}"

    def _facts(self):
        return [("contacts", _contact_names(self.pattern))]


def _contact_names(pattern: tuple) -> str:
    """Return the names of contact codes, separated by commas."""
    return ", ".join(_CONTACT_NAMES[code] for code in pattern)


def _complex_text(real: Enclosure, imaginary: Enclosure) -> str:
    """Return the text of a complex number; a real number has no imaginary part."""
    is_real = not imaginary.low and not imaginary.high
    return f"{real}" if is_real else f"{real}, i ({imaginary})"


def plain(value: Any, exact: bool = False) -> Any:
    """Return a value for JSON, without classes; with `exact` floats become hexadecimal texts."""
    if isinstance(value, Enclosure):
        return [str(value.low), str(value.high)]
    if isinstance(value, (ContactEvent, Piece)):
        value = vars(value)
    if isinstance(value, dict):
        return {name: plain(item, exact) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, exact) for item in value]
    return value.hex() if exact and isinstance(value, float) else value
