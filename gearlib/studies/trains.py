"""Compute the forces in all meshes of gear trains over speed, and Campbell diagrams.

Every motion is computed from many random initial states; see `gearlib.studies.many_starts`.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.motions import FRACTION_TOLERANCE, force_ratio
from gearlib.data.result import make_result
from gearlib.models.pair import GearPair
from gearlib.models.trains.ready_made import split_power_reducer
from gearlib.studies import many_starts

#: Number of equal branches of the reducer, which are countershafts with two gears each.
BRANCHES = 3
#: Variables of train sweeps whose median and range over the initial states are computed.
_QUANTITIES = ("load_sharing", "contact_loss_fraction")


def build_reducer(pair: GearPair, settings: dict, **changes: Any) -> Any:
    """Build the paper's split-power reducer as a `GearTrain`.

    Its tuning is mesh frequency over natural frequency of the gear pair. `settings` has the keys
    teeth, modules, shaft_stiffness, support_stiffness and damping_ratio. `changes` are further
    arguments of `gearlib.split_power_reducer`.
    """
    frequency = pair.mesh_frequency(1.0)
    names = ("teeth", "modules", "shaft_stiffness", "support_stiffness")
    arguments = {name: settings[name] for name in names} | {
        "branches": BRANCHES,
        # The ratio of damping to stiffness (s) results in the damping ratio at this frequency.
        "structural_damping": 2.0 * settings["damping_ratio"] / frequency,
        "reference_frequency": frequency / (2.0 * np.pi),
    }
    return split_power_reducer(pair, **arguments | changes)


def sweep_reducer(pair: GearPair, tunings: Sequence[float], settings: dict) -> xr.Dataset:
    """Sweep the reducer over tuning: force and contact of all meshes, without and with errors.

    The tuning is mesh frequency over natural frequency. `settings` has the keys teeth, modules,
    shaft_stiffness, support_stiffness and damping_ratio of the reducer; the keys
    `many_starts.SETTINGS` (number, seed and spread of random initial states, and mesh periods of
    the runs); pin_error (radial and tangential, m); and backlashes (m, one per branch). The cases
    are "alike" (all branches are equal), "pin_error" (misplaced axis of the first branch) and
    "unequal_backlash".
    """
    tunings = np.asarray(tunings, float)
    backlashes = [(backlash, backlash) for backlash in settings["backlashes"]]
    equal_branches = build_reducer(pair, settings)
    # Radial and tangential pin errors (m); only the first branch has an error.
    pin_errors = [tuple(settings["pin_error"])] + [(0.0, 0.0)] * (BRANCHES - 1)
    trains = {
        "alike": equal_branches,
        "pin_error": build_reducer(pair, settings, pin_errors=pin_errors),
        "unequal_backlash": build_reducer(pair, settings, backlashes=backlashes),
    }
    # Mesh names such as "first 2" consist of stage and branch.
    names = equal_branches.mesh_names
    branch = np.array([int(name.split()[1]) for name in names], np.int32)
    stage = np.array([1 if name.startswith("first") else 2 for name in names], np.int32)
    cases = [_sweep_reducer_case(train, tunings, settings, branch) for train in trains.values()]
    dataset = xr.concat(cases, xr.IndexVariable("case", [*trains]), combine_attrs="override")
    dataset = dataset.assign(
        mesh_branch=("mesh", branch),
        mesh_stage=("mesh", stage),
        speed=("tuning", equal_branches.speed(tunings)),
    ).assign_coords(tuning=tunings, mesh=list(names), branch=np.unique(branch))
    title = "All meshes of a reducer with three double satellites"
    reported = ("pin_error", "backlashes", *many_starts.SETTINGS)
    parameters = {"method": "exact", "initial_state": "static"}
    parameters |= {name: settings[name] for name in reported}
    return make_result(title, equal_branches, dataset.merge(equal_branches.layout()), **parameters)


def _sweep_reducer_case(
    train: Any, tunings: np.ndarray, settings: dict, mesh_branches: np.ndarray
) -> xr.Dataset:
    """Compute the sweep of a reducer, its largest force ratios, and fractions of initial states.

    lost_alone_share is the fraction of initial states from which only one branch loses contact, and
    struck_alone_share the fraction from which only one branch has coast-side contact; both are
    given for each branch. `mesh_branches` has the branch number of each mesh. `settings` has the
    keys `many_starts.SETTINGS` (number, seed and spread of initial states, mesh periods).
    """
    quantities = train.force_ratio_name, *_QUANTITIES
    sweep, motions = many_starts.sweep_random_starts(train, tunings, settings, quantities)
    losses = [motion.contact_loss_fraction.values > FRACTION_TOLERANCE for motion in motions]
    coast_contacts = [motion.fraction_coast.values > FRACTION_TOLERANCE for motion in motions]
    loss_fractions = [single_branch_fraction(loss, mesh_branches) for loss in losses]
    coast_fractions = [single_branch_fraction(contact, mesh_branches) for contact in coast_contacts]
    # Force ratios are only used where all initial states lead to the same orbit.
    ratios = force_ratio(sweep).where(sweep.settled == 1)
    largest_index = ratios.fillna(-np.inf).argmax("tuning")
    largest_tuning = xr.DataArray(tunings, dims="tuning").isel(tuning=largest_index)
    dims = ("direction", "tuning", "branch")
    return sweep.assign(
        lost_alone_share=(dims, loss_fractions),
        struck_alone_share=(dims, coast_fractions),
        largest_ratio=ratios.max("tuning"),
        largest_ratio_tuning=largest_tuning.where(ratios.notnull().any("tuning")),
    )


def single_branch_fraction(occurs: np.ndarray, mesh_branches: np.ndarray) -> np.ndarray:
    """Return the fraction of initial states from which an event occurs in one branch only.

    The mask `occurs`, shape (initial states, tunings, meshes), is true where the event occurs.
    `mesh_branches` has the branch number of each mesh. The result has the shape (tunings,
    branches).
    """
    numbers = np.unique(mesh_branches)
    masks = [occurs[..., mesh_branches == number].any(axis=-1) for number in numbers]
    in_branch = np.stack(masks, axis=-1)
    return (in_branch & (in_branch.sum(axis=-1, keepdims=True) == 1)).mean(axis=0)


def reducer_rows(characteristics: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of the reducer, beginning with the column names.

    `characteristics` has the sweeps from `sweep_reducer` over tuning (mesh frequency over natural
    frequency). Each case, direction and mesh has a row. The last three columns list tunings at
    which, from all initial states, only the branch of the mesh loses contact; at which only this
    branch has coast-side contact (far_flank_struck); and at which the motion does not settle.
    """
    ratio_names = ["largest_peak_force_ratio", "at_tuning", "at_speed_rpm"]
    events = ("contact_lost", "far_flank_struck")
    branch_names = [f"{event}_in_its_branch_only_at" for event in events]
    yield ["case", "direction", "mesh", *ratio_names, *branch_names, "not_settled_at"]
    tunings = characteristics.tuning.values
    speed_per_tuning = float(characteristics.speed[0] / characteristics.tuning[0])
    cells = characteristics.stack(cell=("case", "direction", "mesh"), create_index=False)
    for i in range(cells.sizes["cell"]):
        cell = cells.isel(cell=i)
        is_settled = cell.settled.values == 1
        tuning = float(cell.largest_ratio_tuning)
        branch = cell.sel(branch=int(cell.mesh_branch))
        loses_contact = is_settled & (branch.lost_alone_share.values == 1.0)
        has_coast_contact = is_settled & (branch.struck_alone_share.values == 1.0)
        masks = loses_contact, has_coast_contact, ~is_settled
        tuning_lists = [" ".join(f"{nu:g}" for nu in tunings[mask]) for mask in masks]
        ratio = f"{float(cell.largest_ratio):.4g}"
        names = [cell[name].item() for name in ("case", "direction", "mesh")]
        speed = _format_rounded(speed_per_tuning * tuning)
        yield [*names, ratio, f"{tuning:g}", speed, *tuning_lists]


def sweep_train(train: Any, tunings: Sequence[float], settings: dict) -> xr.Dataset:
    """Sweep a gear train over tuning: force and contact of all meshes.

    The tuning is mesh frequency over natural frequency. `settings` has the keys
    `many_starts.SETTINGS`: starts, first_starts, seed and spread of random initial states, periods
    and record_periods (numbers of computed and of evaluated mesh periods).
    """
    tunings = np.asarray(tunings, float)
    quantities = train.force_ratio_name, *_QUANTITIES
    dataset, _ = many_starts.sweep_random_starts(train, tunings, settings, quantities)
    dataset = dataset.assign(speed=("tuning", train.speed(tunings)))
    dataset = dataset.assign_coords(tuning=tunings, mesh=list(train.mesh_names))
    title = "All meshes of a gear train over speed"
    parameters = {"method": "exact", "initial_state": "static"} | settings
    return make_result(title, train, dataset.merge(train.layout()), **parameters)


def compute_campbell_diagram(
    characteristics, orders: int, pair=None, settings=None, train=None
) -> xr.Dataset:
    """Compute the Campbell diagram of a train, and the speeds at which its meshes lose contact.

    A Campbell diagram shows the natural frequencies and the speeds at which multiples of mesh
    frequencies coincide with them. `characteristics` has the sweeps from `sweep_train`, if `train`
    is given, or from `sweep_reducer` with `pair` and `settings`, of which the case of equal
    branches is used. `orders` is the highest multiple of each mesh frequency. In the dataset,
    mesh_rate is the frequency of each mesh relative to the reference mesh, and
    contact_loss_fraction_high the largest fraction of time without contact over all initial states.
    """
    model = train or build_reducer(pair, settings)
    sweeps = characteristics if train else characteristics.sel(case="alike", drop=True)
    data = model.campbell(orders).drop_vars("modal_force").merge(model.layout())
    names = ["contact_loss_fraction_high", "settled", "speed"]
    data = data.assign({name: sweeps[name] for name in names})
    data["mesh_rate"] = "mesh", [float(ratio) for ratio in model.frequency_ratios]
    name = "gear train" if train else "reducer with three double satellites"
    return make_result(f"Campbell diagram of a {name}", model, data, method="exact", orders=orders)


def campbell_rows(diagram: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of critical speeds, ordered by speed, after the column names.

    `diagram` is a dataset from `compute_campbell_diagram`. At a critical speed, a multiple of a
    mesh frequency equals a natural frequency. Critical speeds above the range of the sweep are
    omitted. Modes with equal frequencies share a row.
    """
    speeds = diagram.speed.values
    loss = diagram.contact_loss_fraction_high.values
    # Contact may be lost in any direction of the sweep and in any mesh.
    loses_contact = (loss > FRACTION_TOLERANCE).any(axis=(0, 2))
    # Texts of a row -> (critical speed, whether the mode is excited).
    intersections: dict[tuple, tuple[float, bool]] = {}
    for order in diagram.stiffness_order.values:
        for mode in diagram.mode.values:
            cell = diagram.sel(stiffness_order=order, mode=mode)
            speed, frequency = float(cell.critical_speed), float(cell.natural_frequency)
            numbers = _format_rounded(speed), f"{order:.4g}", _format_rounded(frequency)
            texts = *numbers, str(cell.mode_kind.item())
            if speed <= speeds[-1]:
                _, is_excited = intersections.get(texts, (0.0, False))
                intersections[texts] = speed, bool(cell.excites) or is_excited
    header = ["critical_speed_rpm", "order_over_first_mesh", "natural_frequency_hz", "mode_kind"]
    yield [*header, "excited", "contact_lost_at_the_nearest_speed_swept"]
    for texts, (speed, is_excited) in sorted(intersections.items(), key=lambda item: item[1][0]):
        # Below the range of the sweep, contact loss is unknown and the cell is empty.
        contact_lost = "yes" if loses_contact[np.abs(speeds - speed).argmin()] else "no"
        yield [*texts, "yes" if is_excited else "no", contact_lost if speed >= speeds[0] else ""]


def _format_rounded(value: float) -> str:
    """Format a value without decimals, or with three significant digits if it is below 100."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
