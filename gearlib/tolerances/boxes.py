"""`certify_box`: a stable orbit without contact loss, proven at every point of a box of parameters.

Of a `GearPair` the numbers of a box are balls, with which the orbit and its multipliers are
enclosed, see `gearlib.tolerances.kept_contact`; where that decides nothing the box is cut in two.

Of a train errors of assembly and loads are forces and gaps: with all flanks in contact the motion
is affine in them, and so is its distance from every flank line. Between points at which the orbit
is proven all orbits keep contact too: the corners of a box prove it.
"""

import heapq
import itertools
import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.proofs.balls import flint, precision
from gearlib.analysis.proofs.orbits import certify
from gearlib.kernels.codes import NORMAL
from gearlib.models.derivatives import unchecked
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import check_speed
from gearlib.tolerances.kept_contact import KeptContact

_BITS = 64
#: Share of a box over which its widths are compared.
_NARROW = 1e-6
#: Most parameters of a train: a box has 2^k corners.
_MOST = 12


@dataclass(frozen=True)
class BoxCertificate:
    """The parts of a box of parameters in which the statement is proven, and those left open."""

    names: tuple
    units: tuple  #: of the parameters, as CF has them; "1" where a function gives them no unit
    speed: float  #: rpm
    box: np.ndarray  #: least and largest values, shape (k, 2)
    certified: np.ndarray  #: shape (c, k, 2)
    open: np.ndarray  #: shape (o, k, 2)

    @property
    def share(self):
        """Share of the box, by volume, in which a stable orbit without contact loss is proven."""
        whole = np.ptp(self.box, axis=1)
        return float(np.prod(np.ptp(self.certified, axis=2) / whole, axis=1).sum())

    def __bool__(self):
        return not len(self.open)

    def proves(self, values):
        """Return whether it is proven at a point, values in the order of `names`."""
        at = np.asarray(values, float)[:, None]
        inside = (self.certified[..., :1] <= at) & (at <= self.certified[..., 1:])
        return bool(inside.all(axis=(1, 2)).any())


def certify_box(model, box, speed, *, pieces=2000):
    """Prove a stable orbit without contact loss at every point of a box of parameters.

    Parameters
    ----------
    model : GearPair, GearTrain or callable
        A function takes the parameters as keyword arguments and returns a train, in which only
        errors of assembly and torques change, and in proportion: as pin errors do.
    box : mapping
        Name of a parameter -> (least, largest value), SI: of a pair its fields, of a train errors
        of meshes, as "error of mesh sun 1", and "load".
    speed : float
        rpm.
    pieces : int, default 2000
        Most pieces that are tried.

    Returns
    -------
    BoxCertificate
        Pieces that are certified and pieces that are open, the share that is certified; true if
        that is all.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.
    """
    pieces = checks.integer("pieces", pieces, 1)
    if not hasattr(box, "items") or not box:
        raise checks.refusal("box", box, "a mapping of parameters to (least, largest value)")
    ends = []
    for name, one in box.items():
        low, high = checks.numbers(f"box[{name!r}]", one, 2)
        checks.require(-math.inf < low < high < math.inf, f"box[{name!r}]", one, "finite, rising")
        ends.append((low, high))
    names, ends = tuple(box), np.array(ends)
    own = is_model(model)
    known = model.derivatives if own else {}
    if own and model.mesh is model:
        proof: Any = _OfPair(model, names, ends, speed)
    elif model.train is model if own else callable(model):
        proof = _OfTrain(model, names, ends, speed)
    else:
        raise checks.refusal("model", model, "a GearPair, a GearTrain or a function of one")
    certified, left = [], []
    # The largest first.
    queue = [(-1.0, 0, ends)]
    count = itertools.count(1)
    for _ in range(pieces):
        if not queue:
            break
        size, _, piece = heapq.heappop(queue)
        if proof.holds(piece):
            certified.append(piece)
            continue
        i = proof.widest(piece)
        middle = piece[i].mean()
        if not piece[i, 0] < middle < piece[i, 1]:
            left.append(piece)
            continue
        for end in (0, 1):
            half = piece.copy()
            half[i, 1 - end] = middle
            heapq.heappush(queue, (0.5 * size, next(count), half))
    left += [piece for *_, piece in queue]
    shape = -1, len(names), 2
    return BoxCertificate(
        names,
        tuple(known.get(name, ("1",))[0] for name in names),
        float(speed),
        ends,
        np.array(certified).reshape(shape),
        np.array(left).reshape(shape),
    )


class _OfPair:
    """Boxes of the fields of a `GearPair`."""

    def __init__(self, pair, names, ends, speed):
        self.pair, self.names, self.speed = pair, names, speed
        known = [one.name for one in fields(pair) if one.name != "teeth"]
        for name in names:
            checks.one_of("box", name, known)
        # What the pair itself checks: ranges are intervals, so that both ends stand for all.
        for column in ends.T:
            check_speed(
                pair.replace(**dict(zip(names, column.tolist(), strict=True))), "speed", speed
            )
        self.weights = np.array([self._width(i, ends) for i in range(len(names))])

    def _width(self, i, ends):
        """Return how wide the orbit gets by a parameter, over its own width."""
        middle = ends.mean(axis=1)
        narrow = np.column_stack([middle, middle])
        narrow[i] = middle[i] + _NARROW * (ends[i] - middle[i])
        with precision(_BITS):
            try:
                kept = self._kept(narrow)
            except (ZeroDivisionError, ValueError):
                return 1.0 / np.ptp(ends[i])
            return sum(map(kept.width, range(4))) / np.ptp(narrow[i])

    def widest(self, piece):
        """Return the number of the parameter by which a piece is best cut."""
        return int(np.argmax(self.weights * np.ptp(piece, axis=1)))

    def _kept(self, piece):
        """Return the `KeptContact` of a piece."""
        arb = flint().arb
        values = {one.name: getattr(self.pair, one.name) for one in fields(self.pair)}
        for name, (low, high) in zip(self.names, piece.tolist(), strict=True):
            values[name] = arb(low).union(arb(high))
        mass, rate = values["reduced_mass"], arb(self.speed) * self.pair.teeth * arb.pi() / 30
        return KeptContact(
            [
                arb(values["max_stiffness"]) / (mass * rate * rate),
                arb(values["stiffness_ratio"]),
                arb(values["material_damping"]) / (2 * mass * rate),
                arb(values["contact_ratio"]),
            ]
        )

    def holds(self, piece):
        """Return whether the statement is proven of a piece."""
        with precision(_BITS):
            try:
                kept = self._kept(piece)
            except (ZeroDivisionError, ValueError):
                return False
            return kept.stable() and kept.keeps_contact()


class _OfTrain:
    """Boxes of what the motion of a train is affine in."""

    def __init__(self, model, names, ends, speed):
        self.names, self.speed = names, speed
        checks.require(len(names) <= _MOST, "box", names, f"at most {_MOST} parameters of a train")
        self.train = None if callable(model) else model
        self.function = model
        if self.train is not None:
            known = [name for name in model.derivatives if name.startswith("error of mesh ")]
            for name in names:
                checks.one_of("box", name, (*known, "load"))
        self.size, self._known = np.ptp(ends, axis=1), {}
        corners = [self._at(point) for point in itertools.product(*ends.tolist())]
        middle = self._at(ends.mean(axis=1))
        check_speed(middle, "speed", speed)
        bare = _bare(middle)
        for one in corners:
            if _bare(one) != bare:
                words = "trains that differ in errors of assembly and torques alone"
                raise checks.refusal("model", type(one).__name__, words)
        table = np.array([_affine(one) for one in corners])
        scale = np.maximum(np.abs(table).max(axis=0), 1e-300)
        if (np.abs(_affine(middle) - table.mean(axis=0)) > 1e-9 * scale).any():
            words = "one whose errors and torques change in proportion"
            raise checks.refusal("model", type(middle).__name__, words)

    def _at(self, point):
        """Return the train at a point."""
        given = dict(zip(self.names, map(float, point), strict=True))
        if self.train is not None:
            return _changed(self.train, given)
        found = self.function(**given)
        if not is_model(found) or found.train is not found:
            raise checks.refusal("model", self.function, "a function that returns a GearTrain")
        return found

    def widest(self, piece):
        """Return the number of the parameter by which a piece is best cut."""
        return int(np.argmax(np.ptp(piece, axis=1) / self.size))

    def holds(self, piece):
        """Return whether the statement is proven of a piece: at all its corners."""
        return all(map(self._proven, itertools.product(*piece.tolist())))

    def _proven(self, point):
        if point not in self._known:
            self._known[point] = self._certified(self._at(point))
        return self._known[point]

    def _certified(self, train):
        try:
            tuning = float(train.tuning_at(self.speed))
            orbit = periodic_orbit(train, tuning, period=train.repeats)
        except NoOrbit:
            return False
        if set(orbit.pattern) != {NORMAL} or not orbit.stable:
            return False
        found = certify(orbit, 10)
        return bool(found) and found.stability == "stable"


def _bare(train):
    """Return what is left of a train without errors of assembly and torques, to compare."""
    meshes = tuple(_with(mesh, error=0.0) for mesh in train.meshes)
    bodies = tuple(_with(body, torque=0.0, offset=(0.0, 0.0)) for body in train.bodies)
    return _with(train, meshes=meshes, bodies=bodies).as_dict()


def _affine(train):
    """Return what forces and gaps of a train are affine in."""
    _, waves, constants = train.excitation
    return np.concatenate([waves.ravel(), constants.ravel(), train.structure.load])


def _changed(train, changes):
    """Return a train with a load and errors of meshes changed."""
    share = changes.get("load", train.load) / train.load
    own = {name.removeprefix("error of mesh "): value for name, value in changes.items()}
    meshes = tuple(_with(mesh, error=own.get(mesh.name, mesh.error)) for mesh in train.meshes)
    bodies = tuple(_with(body, torque=body.torque * share) for body in train.bodies)
    return _with(train, meshes=meshes, bodies=bodies)


def _with(part, **changes):
    values = {one.name: getattr(part, one.name) for one in fields(part)}
    return unchecked(type(part), **values | changes)
