"""All meshes of gear trains over speed: the paper's reducer, any other train, Campbell diagrams.

Every motion has many seeded starts, see `gearlib.studies.many_starts`.
"""

import numpy as np
import xarray as xr

from gearlib.data.motions import ROUNDING, lost_share
from gearlib.data.result import result
from gearlib.models.from_values import described
from gearlib.models.pair import GearPair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.studies import many_starts

#: Branches of the reducer, double satellites.
BRANCHES = 3
#: Summaries of every motion: median and range over its starts.
_SUMMARIES = ("dynamic_factor", "load_sharing", "fraction_normal")


def reducer_of(pair, settings, **changes):
    """Return the paper's reducer, a `GearTrain` counted in tunings of the pair alone.

    `settings` are those of the section ``reducer`` of the configuration, `changes` other arguments
    of `gearlib.split_power_reducer`.
    """
    frequency = pair.mesh_frequency(1.0)
    names = ("teeth", "modules", "shaft_stiffness", "support_stiffness")
    arguments = {name: settings[name] for name in names} | {
        "branches": BRANCHES,
        "structural_damping": 2.0 * settings["damping_ratio"] / frequency,
        "reference_frequency": frequency / (2.0 * np.pi),
    }
    return split_power_reducer(pair, **arguments | changes)


def displaced(settings):
    """Return `pin_errors` with the axis of the first satellite displaced, radial, tangential, m."""
    return [tuple(settings["pin_error"])] + [(0.0, 0.0)] * (BRANCHES - 1)


def reducer(pair, tunings, settings):
    """Return all meshes of the reducer over tuning, with equal branches and with two errors.

    `settings` are those of `reducer_of` and `many_starts`, and the errors: pin_error (m, radial and
    tangential) and backlashes (m, by branch). Largest factors are those of settled motions.
    """
    pair, tunings = GearPair(**pair), np.asarray(tunings, float)
    gaps = [(backlash, backlash) for backlash in settings["backlashes"]]
    alike = reducer_of(pair, settings)
    trains = {
        "alike": alike,
        "pin_error": reducer_of(pair, settings, pin_errors=displaced(settings)),
        "unequal_backlash": reducer_of(pair, settings, backlashes=gaps),
    }
    names = alike.mesh_names
    branch = np.array([int(name.split()[1]) for name in names], np.int32)
    stage = np.array([1 if name.startswith("first") else 2 for name in names], np.int32)
    parts = []
    for train in trains.values():
        part, every = many_starts.sweep_with_seeded_starts(train, tunings, settings, _SUMMARIES)
        lost = [lost_share(one.fraction_normal.values) > 0.0 for one in every]
        struck = [one.fraction_inverse.values > ROUNDING for one in every]
        over = ("direction", "tuning", "branch")
        factors = part.dynamic_factor.where(part.settled == 1)
        top = factors.fillna(-np.inf).argmax("tuning")
        at_top = xr.DataArray(tunings, dims="tuning").isel(tuning=top)
        parts.append(
            part.assign(
                lost_alone_share=(over, [alone_share(one, branch) for one in lost]),
                struck_alone_share=(over, [alone_share(one, branch) for one in struck]),
                largest_factor=factors.max("tuning"),
                factor_tuning=at_top.where(factors.notnull().any("tuning")),
            )
        )
    whole = xr.concat(parts, xr.IndexVariable("case", [*trains]), combine_attrs="override")
    dataset = whole.assign(
        mesh_branch=("mesh", branch),
        mesh_stage=("mesh", stage),
        speed=("tuning", alike.speed(tunings)),
    ).assign_coords(tuning=tunings, mesh=list(names), branch=np.unique(branch))
    title = "All meshes of a reducer with three double satellites"
    stated = ("pin_error", "backlashes", *many_starts.SETTINGS)
    more = {"method": "exact", "initial_state": "static"} | {
        name: settings[name] for name in stated
    }
    return result(title, alike, dataset.merge(alike.layout()), **more)


def alone_share(happens, branch):
    """Return the share of the starts from which something happens in a single branch, that one.

    `happens` has the shape (starts, tunings, meshes), `branch` is that of each mesh; the shares
    have the shape (tunings, branches).
    """
    numbers = np.unique(branch)
    by_branch = np.stack([happens[..., branch == number].any(axis=-1) for number in numbers], -1)
    return (by_branch & (by_branch.sum(axis=-1, keepdims=True) == 1)).mean(axis=0)


def reducer_rows(characteristics):
    """Yield the table of the reducer: a head and a row for each case, direction and mesh."""
    data = characteristics
    factors = ["largest_dynamic_factor", "at_tuning", "at_speed_rpm"]
    only = ["contact_lost_in_its_branch_only_at", "far_flank_struck_in_its_branch_only_at"]
    yield ["case", "direction", "mesh", *factors, *only, "not_settled_at"]
    per_tuning = float(data.speed[0] / data.tuning[0])
    cells = data.stack(cell=("case", "direction", "mesh"), create_index=False)
    for i in range(cells.sizes["cell"]):
        cell = cells.isel(cell=i)
        settled, tuning = cell.settled.values == 1, float(cell.factor_tuning)
        shares = cell.sel(branch=int(cell.mesh_branch))
        lost, struck = shares.lost_alone_share.values, shares.struck_alone_share.values
        places = settled & (lost == 1.0), settled & (struck == 1.0), ~settled
        listed = [" ".join(f"{nu:g}" for nu in data.tuning.values[place]) for place in places]
        factor = f"{float(cell.largest_factor):.4g}"
        names = [cell[name].item() for name in ("case", "direction", "mesh")]
        yield [*names, factor, f"{tuning:g}", f"{per_tuning * tuning:.0f}", *listed]


def over_speed(train, tunings, settings):
    """Return all meshes of a train over tuning; `train` holds the arguments of `described`."""
    model, tunings = described(**train), np.asarray(tunings, float)
    dataset, _ = many_starts.sweep_with_seeded_starts(model, tunings, settings, _SUMMARIES)
    dataset = dataset.assign(speed=("tuning", model.speed(tunings)))
    dataset = dataset.assign_coords(tuning=tunings, mesh=list(model.mesh_names))
    title = "All meshes of a gear train over speed"
    more = {"method": "exact", "initial_state": "static"} | settings
    return result(title, model, dataset.merge(model.layout()), **more)


def campbell(characteristics, orders, pair=None, settings=None, train=None):
    """Return the Campbell diagram of a train, and the speeds at which its meshes lose contact.

    `characteristics` are those of `over_speed` with `train`, or those of `reducer` with `pair` and
    `settings`, of which equal branches count; `orders` is the highest multiple of each mesh
    frequency.
    """
    model = described(**train) if train else reducer_of(GearPair(**pair), settings)
    sweeps = characteristics if train else characteristics.sel(case="alike", drop=True)
    data = model.campbell(orders).drop_vars("modal_force").merge(model.layout())
    data = data.assign(
        {name: sweeps[name] for name in ("fraction_normal_high", "settled", "speed")}
    )
    data["mesh_rate"] = "mesh", [float(rate) for rate in model.rates]
    kind = "gear train" if train else "reducer with three double satellites"
    return result(f"Campbell diagram of a {kind}", model, data, method="exact", orders=orders)


def campbell_rows(diagram):
    """Yield the table of the intersections up to the fastest speed swept, in the order of speed."""
    speeds = diagram.speed.values
    lost = (lost_share(diagram.fraction_normal_high.values) > 0.0).any(axis=(0, 2))
    rows = {}
    for order in diagram.stiffness_order.values:
        for mode in diagram.mode.values:
            cell = diagram.sel(stiffness_order=order, mode=mode)
            speed, frequency = float(cell.critical_speed), float(cell.natural_frequency)
            row = f"{speed:.0f}", f"{order:.4g}", f"{frequency:.0f}", str(cell.mode_kind.item())
            if speed <= speeds[-1]:
                # Modes of one frequency are one row.
                excited = bool(cell.excites) or rows.get(row, (0.0, False))[1]
                rows[row] = speed, excited
    head = ["critical_speed_rpm", "order_over_first_mesh", "natural_frequency_hz", "mode_kind"]
    yield [*head, "excited", "contact_lost_at_the_nearest_speed_swept"]
    for row, (speed, excited) in sorted(rows.items(), key=lambda item: item[1][0]):
        parts = "yes" if lost[np.abs(speeds - speed).argmin()] else "no"
        yield [*row, "yes" if excited else "no", parts if speed >= speeds[0] else ""]
