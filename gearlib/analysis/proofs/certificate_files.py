"""Results of proofs: certificates with enclosures, or a `Refusal` with its reason."""

from dataclasses import dataclass
from typing import Any

from gearlib.analysis.proofs.balls import Enclosure
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT

_CONTACT_NAMES = {
    DRIVE: "drive-side contact",
    NO_CONTACT: "free flight",
    COAST: "coast-side contact",
}
#: Status of a refusal due to coincident contact events or too many arcs.
COINCIDENT = "together"
#: Entries of certificates that are exact floats and are written in hexadecimal.
_EXACT_ENTRIES = "tuning", "start", "stop", "derived", "pieces", "missing"


@dataclass(frozen=True)
class Refusal:
    """Result of a failed proof, with the reason; its truth value is False."""

    #: The failed step: model, contacts, distance, fold, derivative, switch, together, grazing,
    #: jammed, period, precision, stability or time.
    status: str
    message: str  #: reason of the refusal

    def __bool__(self) -> bool:
        """Return False, because the proof failed."""
        return False


class ProofFailed(Exception):
    """A step of a proof failed; the arguments are the status and the message of a `Refusal`."""


@dataclass(frozen=True)
class ContactEvent:
    """Gain or loss of a contact in an orbit."""

    phase: Enclosure  #: mesh phase from tau = 0, rad
    before: int  #: contact state before: 1 drive-side contact, 0 no contact, -1 coast-side contact
    after: int  #: contact state after
    velocity: Enclosure  #: dx/dtau, in static deflections


@dataclass(frozen=True)
class MeshEvent(ContactEvent):
    """Gain or loss of a contact in a mesh of a train."""

    mesh: str  #: name of the mesh


class _Claim:
    """A proven statement about a model."""

    claim = ""

    def as_dict(self) -> dict:
        """Return the certificate as a dictionary for JSON: claim, proven values and model.

        An enclosure becomes two decimals, and exact floats become hexadecimal strings.
        """
        # Certificates of ranges store the description of a train in the field `train`.
        values = dict(vars(self))
        model, train = values.pop("model"), values.pop("train", None)
        if not values.get("missing", True):
            # A claim for the whole range has no missing intervals.
            del values["missing"]
        if train:
            values |= vars(train)
        values = {name: json_value(value, name in _EXACT_ENTRIES) for name, value in values.items()}
        parameters = model.as_dict()
        if model.equation is not None:
            # The equation of motion of a pair does not depend on the numbers of teeth.
            parameters.pop("teeth", None)
        return {"claim": self.claim, **values, "model": json_value(parameters, True)}

    def __repr__(self: Any) -> str:
        """Return the claim as text: a title, a line for each proven quantity, and the stability.

        Subclasses provide the format `_tuning_format` and the method `_text_rows`.
        """
        plural = "s" if self.period > 1 else ""
        orbit = f"an orbit of {self.period} mesh period{plural}"
        tuning = self._tuning_format.format(self)
        lines = [f"Proven: {orbit} at {tuning}, {self.stability}"]
        lines += [f"  {name:<13} {text}" for name, text in self._text_rows()]
        return "\n".join([*lines, f"  {self.stability}: {self.reason}"])


@dataclass(frozen=True, repr=False, kw_only=True)
class _OrbitClaim(_Claim):
    """A periodic orbit that is proven to exist; see `docs/theory/proofs.md`."""

    model: Any
    tuning: float
    period: int  #: smallest period, in mesh periods of the reference mesh
    displacement: Any  #: `Enclosure` at tau = 0, in static deflections; a tuple for a train
    velocity: Any  #: `Enclosure` of dx/dtau at tau = 0; a tuple for a train
    events: tuple  #: all contact gains and losses, in their proven order
    radius: float  #: no other orbit with these contacts lies within this distance
    moved: float  #: largest distance of the state from the candidate, in static deflections
    multipliers: tuple  #: pairs of `Enclosure`, real and imaginary part, largest first
    stability: str  #: "stable", "unstable" or "undecided"
    reason: str  #: reason for the stability
    digits: int  #: decimal digits of all enclosures, decimal places of numbers below 1

    _tuning_format = "tuning {0.tuning!r}"


@dataclass(frozen=True, repr=False, kw_only=True)
class Certificate(_OrbitClaim):
    """A proven orbit of one degree of freedom; see `docs/theory/proofs.md`."""

    pattern: tuple  #: sequence of contact states from tau = 0
    displacement_min: Enclosure  #: smallest displacement of the orbit, in static deflections
    displacement_max: Enclosure
    trace: Enclosure  #: trace of the monodromy matrix
    determinant: Enclosure

    claim = "orbit"

    def _text_rows(self) -> list[tuple]:
        """Return the rows (name, value) of proven quantities in the text of the certificate.

        Indented names belong to the row above.
        """
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
class TrainDescription:
    """Meshes and coordinates of a train."""

    meshes: tuple  #: names of the meshes
    contacts: tuple  #: contact state of each mesh at tau = 0
    coordinates: tuple  #: names of the entries of displacement and velocity
    fixed: tuple  #: names of the coordinates that are 0, relative to which a train rotates freely
    derived: dict  #: numbers that the library derives from the model, exact in the proof


@dataclass(frozen=True, repr=False, kw_only=True)
class TrainCertificate(_OrbitClaim, TrainDescription):
    """A proven orbit of a train; see `docs/theory/proofs.md`."""

    claim = "train"

    def _text_rows(self) -> list[tuple]:
        """Return the rows (name, value) of proven quantities in the text of the certificate.

        They are the contacts at tau = 0 (start of a mesh period), the contact events, the largest
        Floquet multiplier, and the radius within which the orbit is unique.
        """
        contacts = zip(self.meshes, self.contacts, strict=True)
        contact_texts = [
            f"{mesh} in {_CONTACT_NAMES[contact_state]}" for mesh, contact_state in contacts
        ]
        rows = [("at tau = 0", ", ".join(contact_texts))]
        for event in self.events:
            event_text = f"{event.phase}  {event.mesh} in {_CONTACT_NAMES[event.after]}"
            rows.append(("  phase", event_text))
        multiplier = (
            f"{_complex_text(*self.multipliers[0])}, the largest of {len(self.multipliers)}"
        )
        radius = f"within {self.radius:.3g}"
        return [*rows, ("multiplier", multiplier), ("the only such orbit", radius)]


@dataclass(frozen=True)
class Piece:
    """A subinterval of a tuning range and a box that contains exactly one orbit at each tuning."""

    start: float  #: lowest tuning nu
    stop: float  #: highest tuning
    #: Centre of the box, exact floats: x and nu dx/dtau (for a train y and nu dy/dtau of the
    #: retained coordinates), then the phases of the contact events.
    centre: tuple
    radii: tuple  #: half widths of the box, exact floats


@dataclass(frozen=True, repr=False)
class RangeCertificate(_Claim):
    """An orbit that is proven at every tuning of a range: one branch with the same contacts."""

    model: Any
    start: float  #: lowest tuning, an exact number
    stop: float  #: highest tuning
    period: int  #: mesh periods
    pattern: tuple  #: sequence of contact states from tau = 0
    stability: str  #: "stable" or "unstable" in the whole range
    reason: str
    pieces: tuple  #: sorted `Piece`s; at a common tuning of two pieces both boxes contain the orbit
    train: Any = None  #: `TrainDescription`, or None with one degree of freedom
    missing: tuple = ()  #: (lowest, highest) tuning of each interval not reached in `max_seconds`

    claim = "range"

    _tuning_format = "every tuning from {0.start!r} to {0.stop!r}"

    def _text_rows(self):
        """Return the rows (name, value) of proven quantities in the text of the certificate."""
        rows = [("not reached", f"from {low!r} to {high!r}") for low, high in self.missing]
        return [("contacts", _contact_names(self.pattern)), *rows]

    @property
    def complete(self) -> bool:
        """Whether the orbit is proven over the whole requested range."""
        return not self.missing


def _contact_names(pattern: tuple) -> str:
    """Return the names of a sequence of contact states, separated by commas."""
    return ", ".join(_CONTACT_NAMES[contact_state] for contact_state in pattern)


def _complex_text(real: Enclosure, imaginary: Enclosure) -> str:
    """Format a complex number; an imaginary part that is exactly 0 is omitted."""
    is_real = not imaginary.low and not imaginary.high
    return f"{real}" if is_real else f"{real}, i ({imaginary})"


def json_value(value: Any, exact: bool = False) -> Any:
    """Convert an entry of a certificate to JSON types: strings, numbers, lists and dictionaries.

    An `Enclosure` (proven interval) becomes a list of two decimal strings. If `exact` is true,
    floats become hexadecimal strings, which preserve all bits.
    """
    if isinstance(value, Enclosure):
        return [str(value.low), str(value.high)]
    if isinstance(value, (ContactEvent, Piece)):
        value = vars(value)
    if isinstance(value, dict):
        return {name: json_value(item, exact) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_value(item, exact) for item in value]
    return value.hex() if exact and isinstance(value, float) else value
