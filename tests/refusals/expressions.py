"""Public names and others, in the expressions of `combinations.yaml`."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import xarray as xr

import gearlib as g
from gearlib import geometry
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER
from tests.properties.known_models import DAMPED

PUBLIC = {name: getattr(module, name) for module in (g, geometry) for name in module.__all__}
RESULTS = (geometry.DynamicFactor, geometry.IsoStiffness, geometry.MeshStiffness)
CALLS = [call for call in PUBLIC.values() if callable(call) and call not in RESULTS]
CALLS += [g.GearPair.from_ratios, g.Harmonics.from_table, g.LoadSharingPair.from_geometry]
CALLS += [geometry.SpurGear.thickness_at, geometry.GearStage.transmission_error]
A = g.Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0)
B = g.Body(name="b", inertia=0.02, base_radius=0.2, teeth=40, torque=200.0)
C = replace(B, name="c", torque=0.0)
AB = g.Mesh(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
paper, stage = PAPER.replace, fzg_c()
a, b, ab = (partial(replace, element) for element in (A, B, AB))
shaft, train = partial(g.Shaft, stiffness=1.0), partial(g.GearTrain, bodies=(A, B), meshes=(AB,))
gear = partial(geometry.SpurGear, teeth=20, module=4e-3, width=0.02)
web = partial(geometry.Web, thickness=0.01, rim_diameter=0.06, hub_diameter=0.04)
planet = partial(geometry.SpurGear, module=3e-3, width=0.025)
ring = partial(planet, internal=True, outer_diameter=0.34)
drawn_set = partial(
    geometry.planetary_set, planet(teeth=27), planet(teeth=36), ring(teeth=99), torque=1.0
)
pair = partial(g.GearPair.from_geometry, stage)
sharing = partial(g.LoadSharingPair, pair=pair(torque=1.0), stage=stage)
factor = partial(geometry.dynamic_factor, stage, 302.0, rpm=100.0)
error = partial(stage.transmission_error, torque=300.0)
simulate, sweep = partial(g.simulate, periods=2), partial(g.sweep, periods=2, record_periods=1)
CHAIN = [f"g{i}" for i in range(202)]
MESHES = [ab(pinion=pinion, wheel=wheel, name=pinion) for pinion, wheel in pairwise(CHAIN)]
ORBIT = g.periodic_orbit(DAMPED, 0.9)
BRANCH = g.continue_orbit(ORBIT, to=0.91, max_points=3)
BRANCH.label[0] = 2  # so that a search may start here: the label of a period doubling
RUN = g.simulate(DAMPED, 0.9, periods=24, record_periods=24)
SPREAD, FREE = {"load": {"std": "1 %"}}, {"reduced_mass": (3.0, 3.2)}
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
