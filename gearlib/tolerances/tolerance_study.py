"""What the workflow asks of tolerances: shards, Sobol' indices, boxes, tightened tolerances."""

import json

import numpy as np
import xarray as xr
from scipy.stats import qmc

from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.data.result import result
from gearlib.models.geometry import described_drawing
from gearlib.models.pair import GearPair
from gearlib.tolerances.boxes import BoxCertificate, certify_box
from gearlib.tolerances.designs import DrawnPair
from gearlib.tolerances.indices import sobol_indices
from gearlib.tolerances.quantities import Followed
from gearlib.tolerances.scatter import shard as shard_of
from gearlib.tolerances.tightening import tighten


def model_of(pair, drawing=None):
    """Return what scatters: a `GearPair` by its parameters, or its drawing.

    `drawing`: as of `gearlib.models.described_pair.described`; dampings are those of the pair.
    """
    model = GearPair(**pair)
    if drawing is None:
        return model
    return DrawnPair(
        described_drawing.mesh(drawing),
        backlash=None if drawing.get("backlash") is None else "drawing",
        torque=drawing["torque"],
        stiffness=drawing.get("stiffness"),
        options=drawing.get("stiffness_options"),
        material_damping=model.material_damping,
        backlash_damping_ratio=model.backlash_damping_ratio,
    )


def compute(*, pair, tolerances, samples, shard, threads, drawing=None, **asked):
    """Return a shard, "first-last", of `gearlib.scatter`; other arguments are as there."""
    first, last = map(int, shard.split("-"))
    model = model_of(pair, drawing)
    return shard_of(model, tolerances, samples, first, last, threads=threads, **asked)


def indices(*, pair, tolerances, samples, drawing=None, **asked):
    """Return Sobol' indices, see `gearlib.tolerances.indices.sobol_indices`."""
    return sobol_indices(model_of(pair, drawing), tolerances, n=samples, **asked)


def kept_contact(*, pair, tolerances, tuning, box, seed, risk, samples, drawing=None, **asked):
    """Return where contact is proven to be kept, and the tolerances that keep it, of a duty point.

    box: name -> (least, largest value) of two parameters of the pair; risk, samples: as of
    `gearlib.tolerances.tightening.tighten`; asked: arguments of `boxed`.

    Over ``piece`` and ``box_parameter``: piece_low, piece_high; over ``piece``: certified. Over
    ``point``: sampled, sampled_margin. All of `tighten`; where no tolerance can keep contact these
    are missing, and the attribute not_tightened says why.
    """
    model = GearPair(**pair)
    speed = float(model.speed(tuning))
    found = boxed(model, box, speed, seed=seed, **asked)
    try:
        ways = {"speed": speed, "risk": risk, "n": samples, "seed": seed}
        tightened, why = tighten(model_of(pair, drawing), tolerances, **ways), {}
    except (ValueError, NoOrbit) as error:
        tightened, why = xr.Dataset(), {"not_tightened": str(error)}
    said = json.loads(tightened.attrs.get("parameters", "{}")) | {"speed": speed, "box": box}
    whole = found.merge(tightened, combine_attrs="drop")
    title = "Where contact is kept within tolerances"
    return result(title, model, whole, method="ball arithmetic", **said).assign_attrs(why)


def boxed(model, box, speed, *, pieces, points, prove, seed):
    """Return pieces of a certified box, and contact margins of points in it."""
    ends = np.array(list(box.values()))
    nothing = np.empty((0, *ends.shape))
    units = tuple(model.derivatives[name][0] for name in box)
    proof = BoxCertificate((*box,), units, speed, ends, nothing, ends[None])
    if prove:
        proof = certify_box(model, box, speed, pieces=pieces)
    both = np.concatenate([proof.certified, proof.open])
    at = qmc.scale(qmc.Halton(len(box), rng=seed).random(points), *ends.T)
    margins = np.full(points, np.nan)
    try:
        follow = Followed(model, (), ("contact_margin",), speed=speed)
    except NoOrbit:
        pass
    else:
        changes = [dict(zip(box, values, strict=True)) for values in at.tolist()]
        margins = np.array([follow(model.replace(**one))[0][0] for one in changes])
    sure = np.arange(len(both)) < len(proof.certified)
    data = {
        "piece_low": (("piece", "box_parameter"), both[..., 0]),
        "piece_high": (("piece", "box_parameter"), both[..., 1]),
        "certified": ("piece", sure.astype(np.int8)),
        "certified_share": proof.share,
        "box_units": ("box_parameter", list(proof.units)),
        "sampled": (("point", "box_parameter"), at),
        "sampled_margin": ("point", margins),
        "proven_points": sum(map(proof.proves, at)),
        "contradictions": sum(proof.proves(one) for one in at[~(margins > 0.0)]),
    }
    return xr.Dataset(data, {"box_parameter": list(box)})
