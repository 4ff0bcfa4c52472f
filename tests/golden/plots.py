"""Pictures of all functions of `gearlib.plot`, and of models beside measured motions."""

import functools
import tempfile
from pathlib import Path

import numpy as np
import yaml
from matplotlib import pyplot

import gearlib
from gearlib import plot, simulate, sweep
from gearlib.figures import measured_figure, style
from gearlib.studies import measured as study
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.geometry.stages import documentation_stage
from tests.paper import PAPER_PAIR

GEAR_STAGE = documentation_stage()
PAIR = gearlib.GearPair.from_geometry(GEAR_STAGE, torque=85.0, damping_ratio=0.12)
FOLDER = Path(__file__).with_name("plots")
PAPER_PAIR = PAPER_PAIR.replace(material_damping=3953.7)

LIGHTLY_DAMPED_PAIR = gearlib.GearPair.from_ratios(
    contact_ratio=1.4, stiffness_ratio=0.6, damping=0.05
)
PLANETARY_TRAIN = gearlib.planetary(turning=True)


def resonance():
    """Draw sweeps up and down through the main resonance."""
    run_options = {"periods": 400, "record_periods": 8}
    tunings = np.linspace(0.6, 1.3, 36)
    sweeps = [sweep(PAIR, tunings, direction=way, **run_options) for way in ("up", "down")]
    return plot.resonance(*sweeps)


def phase_plane():
    runs = [simulate(LIGHTLY_DAMPED_PAIR, nu, periods=400, record_periods=2) for nu in (0.7, 0.85)]
    return plot.phase_plane(*runs)


def time_course():
    return plot.time_course(simulate(PAPER_PAIR, 0.85, periods=400, record_periods=2))


def time_course_of_meshes():
    run = simulate(PLANETARY_TRAIN, 0.9, periods=300, record_periods=2)
    return plot.time_course(run, variable="dynamic_force")


def orbit():
    return plot.orbit(*(gearlib.periodic_orbit(PAIR, nu) for nu in (0.7, 0.9)))


def harris_map():
    return plot.harris_map(GEAR_STAGE.transmission_error(torque=[20.0, 85.0]))


def campbell():
    return plot.campbell(gearlib.split_power_reducer(PAIR).campbell())


def schematic():
    train = gearlib.split_power_reducer(PAIR, internal=True)
    return plot.schematic(train, run=simulate(train, 0.8, periods=100, record_periods=2))


def schematic_of_planets():
    return plot.schematic(PLANETARY_TRAIN, phase=7.0)


def values():
    return plot.values(gearlib.idler(PAIR).modes(), "strain_energy")


def orders():
    spectrum = gearlib.orders(simulate(PAIR, 0.45, periods=423, record_periods=23), count=3)
    return plot.orders(spectrum, variable="error_amplitude")


def orders_of_meshes():
    run = simulate(PLANETARY_TRAIN, 0.9, periods=597, record_periods=297)
    return plot.orders(gearlib.orders(run, count=2))


@functools.cache
def run_up_and_down():
    """Return a run-up through the main resonance and back."""
    speeds = [(0.0, PAIR.speed(0.7)), (0.5, PAIR.speed(1.0)), (1.0, PAIR.speed(0.7))]
    return gearlib.run_up(PAIR, speed=speeds, samples_per_period=64)


def run_up():
    return plot.run_up(run_up_and_down())


def order_map():
    return plot.order_map(
        gearlib.order_map(run_up_and_down(), variable="dynamic_force", highest=60)
    )


def order_map_over_frequency():
    levels = gearlib.order_map(run_up_and_down(), variable="acceleration", highest=60)
    return plot.order_map(levels, vertical="frequency")


def fit():
    """Draw the fit of a perturbed reduced mass to a synthetic run-up."""
    rig = synthetic_rig(PAIR, [(0.0, PAIR.speed(0.6)), (0.1, PAIR.speed(0.72))], 1)
    guess = PAIR.replace(reduced_mass=1.05 * PAIR.reduced_mass)
    free = {"reduced_mass": (0.9 * PAIR.reduced_mass, 1.1 * PAIR.reduced_mass)}
    return plot.fit(gearlib.fit(guess, rig, free))


def _write_measured_set(folder, data, columns, **keys):
    """Write columns of a dataset as a measured set and return the path of its description.

    `columns` maps each name to its unit, and `keys` are further keys of the description.
    """
    folder = Path(folder)
    table = np.column_stack([data[name].values for name in columns])
    np.savetxt(folder / "rig.csv", table, delimiter=",", header=",".join(columns), comments="")
    channels = {name: {"observableId": name, "unit": unit} for name, unit in columns.items()}
    description = {"data": "rig.csv", "title": "rig", "source": "computed", "licence": "own data"}
    description |= {"synthetic": True, "channels": channels} | keys
    (folder / "rig.yaml").write_text(yaml.safe_dump(description), encoding="utf-8")
    return str(folder / "rig.yaml")


def measured_orders():
    """Draw orders of a synthetic measured run-up, of its own model and of another one."""
    rig = synthetic_rig(
        PAPER_PAIR, [(0.0, PAPER_PAIR.speed(0.6)), (0.4, PAPER_PAIR.speed(0.72))], 1
    )
    columns = {"time": "s", "speed": "rpm", "displacement": "m"}
    pairs = {"true": PAPER_PAIR, "damped": PAPER_PAIR.replace(material_damping=8e3)}
    with tempfile.TemporaryDirectory() as folder:
        path = _write_measured_set(folder, rig, columns)
        orders = study.compare_run_ups(path, pairs)
    return measured_figure.draw_orders([orders], colours={"true": "#AA3377"})


def measured_courses():
    """Draw a synthetic measured time history at constant speed and the one of its model."""
    run = simulate(PAPER_PAIR, 0.7, periods=248, record_periods=8, samples_per_period=40)
    time = run.phase / run.mesh_frequency
    data = {"time": time, "displacement": run.displacement * run.static_deflection}
    speed = {"speed": f"{PAPER_PAIR.speed(0.7)} rpm"}
    columns = {"time": "s", "displacement": "m"}
    run_options = {"periods": 240, "record_periods": 24, "samples_per_period": 32}
    with tempfile.TemporaryDirectory() as folder:
        path = _write_measured_set(folder, data, columns, conditions={"one": speed})
        courses = study.compare_time_histories(path, {"true": PAPER_PAIR}, run_options)
    return measured_figure.draw_courses([courses])


_PLOTS = (
    *(resonance, phase_plane, time_course, time_course_of_meshes, orbit, harris_map, campbell),
    *(schematic, schematic_of_planets, values, orders, orders_of_meshes),
    *(run_up, order_map, order_map_over_frequency, fit),
    *(measured_orders, measured_courses),
)
PLOTS = {function.__name__: function for function in _PLOTS}


def draw(name, folder):
    """Draw the plot with a name in PLOTS and save it in a folder."""
    pyplot.switch_backend("Agg")
    result = PLOTS[name]()
    # Some functions return axes, others a figure.
    figure = getattr(result, "figure", result)
    figure.set_dpi(60)
    style.save(figure, folder / f"{name}.png")
    pyplot.close("all")
