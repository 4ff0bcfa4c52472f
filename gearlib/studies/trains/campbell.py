"""Campbell diagram of the paper's reducer or another train, beside what its sweeps say of contact.

The diagram is linear: natural frequencies at mean stiffness against the orders of the mesh
frequencies, and which of the intersections the phases of the meshes let through. The sweeps of the
reducer are those whose branches are alike.
"""

import numpy as np

from gearlib.data.motions import lost_share
from gearlib.data.result import result
from gearlib.models.pair import GearPair
from gearlib.models.trains.described_train import described
from gearlib.studies.trains.reducer import train_of

CASE = "alike"


def compute(characteristics, orders, pair=None, settings=None, train=None):
    """Return critical speeds of a gear train, and the speeds at which its meshes part.

    characteristics: of `gearlib.studies.trains.reducer.compute`, or `over_speed.compute`; orders:
    highest order of each mesh frequency; pair (keyword arguments of `GearPair`: every mesh) and
    settings, as in `gearlib.studies.trains.reducer.train_of`, of the reducer; or train, arguments
    of `gearlib.models.trains.described_train.described`.

    Beside `GearTrain.campbell` and `GearTrain.layout`: the most contact of all starts, which all
    lose it where that is less than 1.
    """
    model = described(**train) if train else train_of(GearPair(**pair), settings)
    data = model.campbell(orders).drop_vars("modal_force")
    sweeps = characteristics if train else characteristics.sel(case=CASE, drop=True)
    for name in ("fraction_normal_high", "settled"):
        data[name] = sweeps[name]
    data["speed"] = sweeps.speed
    data["mesh_rate"] = ("mesh", [float(rate) for rate in model.rates])
    data = data.merge(model.layout())
    title = "Campbell diagram of a reducer with three double satellites"
    title = "Campbell diagram of a gear train" if train else title
    return result(title, model, data, method="exact", orders=orders)


def rows(diagram):
    """Yield the intersections up to the fastest speed swept, in the order of speed."""
    speeds = diagram.speed.values
    lost = (lost_share(diagram.fraction_normal_high.values) > 0.0).any(axis=(0, 2))
    found = {}
    for order in diagram.stiffness_order.values:
        for mode in diagram.mode.values:
            one = diagram.sel(stiffness_order=order, mode=mode)
            speed = float(one.critical_speed)
            if speed > speeds[-1]:
                continue
            row = f"{speed:.0f}", f"{order:.4g}", f"{float(one.natural_frequency):.0f}"
            row += (str(one.mode_kind.item()),)
            parts = ""
            if speed >= speeds[0]:
                parts = "yes" if lost[np.abs(speeds - speed).argmin()] else "no"
            excited = bool(one.excites) or found.get(row, (False,))[0]
            found[row] = excited, speed, parts
    names = ["critical_speed_rpm", "order_over_first_mesh", "natural_frequency_hz", "mode_kind"]
    yield [*names, "excited", "contact_lost_at_the_nearest_speed_swept"]
    for row, (excited, _, parts) in sorted(found.items(), key=lambda item: item[1][1]):
        yield [*row, "yes" if excited else "no", parts]
