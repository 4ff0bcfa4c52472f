"""What a proof returns: a `Certificate` with its enclosures, or a `Refusal` with its reason."""

from dataclasses import dataclass, fields
from typing import Any

from gearlib.analysis.proofs.balls import Enclosure, enclosure
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL

_WORDS = {NORMAL: "normal mesh", BACKLASH: "backlash", INVERSE: "inverse mesh"}


@dataclass(frozen=True)
class Refusal:
    """Nothing is proven; false where a truth value is asked for."""

    status: str  #: the step that failed, one of `REFUSALS`
    message: str  #: what failed, in a sentence

    def __bool__(self):
        return False


class Uncertain(Exception):
    """A step of a proof failed: (status, sentence). What proofs raise, inside."""


#: The steps that may fail, and what that says.
REFUSALS = {
    "model": "no proof is written for this model",
    "contacts": "the motion from the candidate has other contacts than the candidate lists",
    "distance": "there is no orbit within the stated distance of the candidate, or none is found",
    "fold": "the derivative of the equations is singular, or too nearly so",
    "derivative": "derivatives do not agree with differences of the equations: a fault of gearlib",
    "switch": "a contact coincides with a switch of the stiffness or the start of a mesh period",
    "together": "contacts of several meshes come together and are not passed, or are too many",
    "grazing": "the motion comes too near to a flank line without crossing it, or crosses too flat",
    "jammed": "both flanks of a mesh touch at once, or it is not proven that they do not",
    "period": "the orbit repeats after fewer mesh periods than the candidate says",
    "precision": "the digits asked for were not reached",
    "stability": "the stability changes within the range, or is not proven",
}


@dataclass(frozen=True)
class ContactEvent:
    """A contact that is gained or lost."""

    phase: Enclosure  #: mesh phase from tau = 0, rad
    before: int  #: contact code before: 1 normal mesh, 0 backlash, -1 inverse mesh
    after: int
    velocity: Enclosure  #: dx/dtau, in static deflections


class _Claim:
    """What is proven, as a dict."""

    claim = ""
    exact: tuple = ()  #: names of floats that are exact numbers

    def as_dict(self):
        """Return all of it as plain values: enclosures as two decimals, exact floats as bits."""
        bits = {name: number(getattr(self, name)) for name in self.exact}
        return as_claim(self) | bits


class _OrbitClaim(_Claim):
    """A proven orbit in words: what it is, what is said of it alone, that it is the only one."""

    exact = ("tuning",)
    tuning: float
    period: int
    radius: float
    stability: str
    reason: str

    def _lines(self):
        raise NotImplementedError

    def __repr__(self):
        lines = [
            f"Proven: {_orbit(self.period)} at tuning {self.tuning!r}, {self.stability}",
            *self._lines(),
            f"  the only such orbit within {self.radius:.3g}",
            f"  {self.stability}: {self.reason}",
        ]
        return "\n".join(lines)


@dataclass(frozen=True, repr=False)
class Certificate(_OrbitClaim):
    """A periodic orbit that is proven to exist; see `docs/theory/proofs.md`."""

    pair: object
    tuning: float
    period: int  #: mesh periods; it does not repeat after fewer
    pattern: tuple  #: contact codes in the order met, from tau = 0
    displacement: Enclosure  #: at tau = 0, in static deflections
    velocity: Enclosure  #: dx/dtau at tau = 0
    events: tuple  #: all contacts gained and lost, `ContactEvent` in their order
    displacement_min: Enclosure  #: smallest displacement of the orbit, in static deflections
    displacement_max: Enclosure
    radius: float  #: no other orbit with these contacts has state and phases this close
    moved: float  #: most that the state may lie away from the candidate, in static deflections
    trace: Enclosure  #: of the map of small deviations over the orbit
    determinant: Enclosure
    multipliers: tuple  #: two pairs of `Enclosure`, real and imaginary part
    stability: str  #: "stable", "unstable" or "undecided"
    reason: str  #: why, in a sentence
    digits: int  #: decimal digits of all enclosures, of numbers below 1 behind the point

    claim = "orbit"

    def _lines(self):
        lines = [
            f"  displacement  {self.displacement}",
            f"  velocity      {self.velocity}",
            f"  smallest x    {self.displacement_min}",
            f"  largest x     {self.displacement_max}",
            f"  contacts      {_met(self.pattern)}",
        ]
        lines += [f"    phase       {event.phase}" for event in self.events]
        return lines + [f"  multiplier    {_complex(*pair)}" for pair in self.multipliers]


@dataclass(frozen=True)
class MeshEvent(ContactEvent):
    """A contact that a mesh of a train gains or loses."""

    mesh: str


@dataclass(frozen=True, repr=False)
class TrainCertificate(_OrbitClaim):
    """A periodic orbit of a train that is proven to exist; see `docs/theory/proofs.md`."""

    pair: Any  #: the model
    tuning: float
    period: int  #: mesh periods of the reference mesh; it does not repeat after fewer
    meshes: tuple  #: their names
    contacts: tuple  #: contact code of every mesh at tau = 0
    coordinates: tuple  #: their names
    fixed: tuple  #: of these 0 throughout: a free rotation is counted from them
    displacement: tuple  #: of every coordinate at tau = 0, `Enclosure`, in static deflections
    velocity: tuple  #: dq/dtau at tau = 0, `Enclosure`
    events: tuple  #: all contacts gained and lost, `MeshEvent` in their order, where it is proven
    radius: float  #: no other orbit with these contacts has state and phases this close
    moved: float  #: most that the state may lie away from the candidate, in static deflections
    multipliers: tuple  #: pairs of `Enclosure`, real and imaginary part, the largest first
    stability: str  #: "stable", "unstable" or "undecided"
    reason: str  #: why, in a sentence
    digits: int  #: decimal digits of all enclosures, of numbers below 1 behind the point
    derived: dict  #: numbers that the library derives from the model, exact ones in the proof

    claim = "train"

    def _lines(self):
        both = zip(self.meshes, self.contacts, strict=True)
        starts = ", ".join(f"{name} in {_WORDS[code]}" for name, code in both)
        return [
            f"  at tau = 0    {starts}",
            *(
                f"    phase       {event.phase}  {event.mesh} in {_WORDS[event.after]}"
                for event in self.events
            ),
            f"  multiplier    {_complex(*self.multipliers[0])}, the largest of "
            f"{len(self.multipliers)}",
        ]


@dataclass(frozen=True)
class TrainFacts:
    """What the numbers of a train belong to: there displacement and velocity are tuples."""

    meshes: tuple  #: their names
    contacts: tuple  #: contact code of every mesh at the start
    coordinates: tuple  #: their names
    fixed: tuple  #: of these 0 throughout: a free rotation is counted from them
    derived: dict  #: numbers that the library derives from the model, exact ones in the proof


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

    pair: object
    start: float  #: the lower tuning, an exact number
    stop: float  #: and the upper one
    period: int  #: mesh periods
    pattern: tuple  #: contact codes in the order met, from tau = 0
    stability: str  #: as of `Certificate`, the same in the whole range
    reason: str
    pieces: tuple  #: of the range, `Piece`, ascending; where two meet the orbit is in both boxes
    train: Any = None  #: `TrainFacts`; None: one degree of freedom

    claim, exact = "range", ("start", "stop")

    def __repr__(self):
        return (
            f"Proven: {_orbit(self.period)} at every tuning from {self.start!r} to "
            f"{self.stop!r}, {self.stability}\n"
            f"  contacts      {_met(self.pattern)}\n"
            f"  {self.stability}: {self.reason}"
        )

    def as_dict(self):
        """Return all of it as plain values, exact floats as texts that say all their bits."""
        return super().as_dict() | {"pieces": [numbers(vars(one)) for one in self.pieces]}


def _orbit(period):
    return f"an orbit of {period} mesh period{'s' * (period > 1)}"


def _met(pattern):
    return ", ".join(_WORDS[code] for code in pattern)


def _complex(real, imaginary):
    return f"{real}" if not imaginary.low and not imaginary.high else f"{real}, i ({imaginary})"


def as_claim(certificate):
    """Return a certificate as a dict of plain values that names its claim."""
    values = {field.name: getattr(certificate, field.name) for field in fields(certificate)}
    train = values.pop("train", None)
    values |= vars(train) if train else {}
    if "derived" in values:
        values["derived"] = numbers(values["derived"])
    # What has no part in the motion: the teeth of a pair.
    without = () if certificate.pair.equation is None else ("teeth",)
    plain_values = {name: plain(value) for name, value in values.items()}
    parameters = numbers(certificate.pair.as_dict(), without)
    return {"claim": certificate.claim} | plain_values | {"pair": parameters}


def listed(contacts, digits, names=()):
    """Return (phase, mesh, code before, code after, rate) of contacts as a tuple of events.

    `MeshEvent` where the names of meshes are given, else `ContactEvent`.
    """
    found = []
    for phase, mesh, before, after, rate in contacts:
        values = enclosure(phase, digits), before, after, enclosure(rate, digits)
        found.append(MeshEvent(*values, names[mesh]) if names else ContactEvent(*values))
    return tuple(found)


def plain(value):
    """Return a value of a certificate as JSON has it."""
    if isinstance(value, Enclosure):
        return value.as_list()
    if isinstance(value, ContactEvent):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return value


def number(value):
    """Return an exact floating-point number as a text that says all its bits."""
    return float(value).hex()


def numbers(value, without=()):
    """Return the parameters of a model with exact numbers, in lists and dicts as they are."""
    if isinstance(value, dict):
        return {name: numbers(one, without) for name, one in value.items() if name not in without}
    if isinstance(value, (list, tuple)):
        return [numbers(one, without) for one in value]
    return number(value) if isinstance(value, float) else value
