"""Define the commands, which call the library, print its results and plot them."""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import click

import gearlib
from gearlib import checks
from gearlib.cli import options, output
from gearlib.cli.gears import DEFAULT_CONFIG, NO_DAMPING, pop_gears, speed_in_rpm
from gearlib.config import measured_description, schema_text, tolerances_section, validation
from gearlib.config.gear_pair_section import DAMPINGS, GearPairSection
from gearlib.models import tolerated
from gearlib.units import WRITTEN_UNITS

#: Folder that contains the Snakefile, in the installed package or in a checkout.
_INSTALLED = Path(__file__).parents[1] / "installed_workflow"
_WORKFLOW_ROOT = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2]
#: Names of options of the commands `simulate`, `run-up`, `sweep` and `scatter`.
_RUN_OPTIONS = "tuning speed initial_state periods record_periods samples method until_settled"
_RUN_UP_OPTIONS = "duration acceleration back initial_state driver max_seconds"
_SWEEP_OPTIONS = "periods record_periods method max_seconds"
_SCATTER_OPTIONS = (
    "tolerance thickness_class distance_class quality quantity samples speed start stop"
)
#: The argument DATA of the command `fit`.
_DATA_ARGUMENT = click.Argument(["path"], metavar="DATA", type=options.FILE)
_MAX_TABLE_ROWS = 14  #: number of speeds in the printed table of sweeps up and down
_STIFFNESS_CURVE_SAMPLES = 257  #: samples per mesh period of a plotted stiffness curve


@click.group(
    cls=options.Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 success; 1 the computation failed; 2 wrong input.",
)
@click.version_option(gearlib.__version__, prog_name="gearlib")
def main():
    """Nonlinear dynamics of gear meshes.

    The gears are described by a configuration (--config, --damping), by options, or by both;
    options take precedence. Values may have units, as in --backlash "40 um". The section `train`
    describes the gear train for --model train and for modes, static, phasing and campbell.
    """


def gear_command(
    name, option_names, dimension, motion="sweep", arguments=(), prepare=None, rectangle=False
):
    """Return a decorator that turns a function into the command `name`.

    The command calls the function with `Gears`, their model and the values of the options named in
    `option_names` (separated by spaces). The function returns a dataset and a function that plots
    it with `gearlib.plot`. `arguments` are additional click parameters. `prepare` is called with
    the dict of option values and may change it in place. A CSV file has one row per entry along
    `dimension`. `motion` is "one speed", "sweep" or, for gear trains at rest, "none". If
    `rectangle` is true, a rectangular mesh stiffness replaces the tooth pair model.
    """

    def run_command(function, values):
        """Create gears from the option `values`, call `function`, and write and plot its result."""
        from gearlib.runs.run_arguments import tuning_of

        data_path, plot_path, force = (values.pop(key) for key in ("output", "plot", "force"))
        output.check_path("--output", data_path, force, options.DATA)
        output.check_path("--plot", plot_path, force, options.PICTURES)
        if prepare:
            prepare(values)
        if motion == "none":
            values["model"] = "train"
        configured_gears = pop_gears(values, needs_damping=motion != "none")
        gears = configured_gears.with_rectangular_stiffness() if rectangle else configured_gears
        section = configured_gears.configuration.gears
        # At each speed of a sweep, a whole cycle of pitch errors would take too long.
        model = gears.model(pitch_errors=motion != "sweep")
        description = gears.description(model)
        if motion == "one speed":
            # If neither --speed nor --tuning is given, use the speed of the section `gears`.
            speed = values.pop("speed")
            if speed is None and values["tuning"] is None and section:
                speed = section.speed
            values["tuning"] = tuning_of(model, values["tuning"], speed_in_rpm("speed", speed))
        if name in ("simulate", "sweep", "trust") and not values.get("initial_state"):
            values["initial_state"] = "static" if gears.kind == "teeth" else (0.0, 0.0)
        click.echo(click.wrap_text(description, output.WIDTH))
        notes = [model.force_note] if motion != "none" and section else []
        if gears.kind == "teeth" and motion == "sweep" and section.modification_key("pitch_errors"):
            notes.append("Pitch errors are neglected, but `gearlib simulate` includes them.")
        if gears is not configured_gears:
            speed = speed_in_rpm("speed", values.get("speed"))
            notes.append(_tooth_pair_note(configured_gears, model, speed))
        for note in filter(None, notes):
            click.echo(click.wrap_text(note, output.WIDTH))
        dataset, plot_dataset = function(gears, model, **values)
        if "stiffness_model" in dataset.attrs:
            dataset.attrs["stiffness_model"] = gears.stiffness(model)
        if data_path:
            output.write_dataset(data_path, dataset, dimension)
        if plot_path:
            output.save_picture(plot_path, description, plot_dataset, model, dataset)

    gear_options = options.PAIR_OPTIONS if motion == "none" else options.MODEL_OPTIONS
    parameters = [*arguments, *gear_options]
    parameters += options.command_options(name, f"{option_names} output plot force")
    return lambda function: main.command(name, params=parameters, help=function.__doc__)(
        lambda **values: run_command(function, values)
    )


def _tooth_pair_note(gears, model, speed):
    """Return a note on contact loss and dynamic factor of gears with load-dependent stiffness.

    An analysis that needs a rectangular stiffness prints this note to show what it neglects.
    `gears` are of the kind "teeth", and `model` is their simplified model with rectangular
    stiffness. If `speed` (rpm) is None, the speed of the gears is used or, if they have none, the
    resonance speed of `model`.
    """
    from gearlib.analysis.duty_point import duty_point

    # The tuning, mesh frequency over natural frequency, is 1 at resonance.
    speed = speed or gears.geometry.speed or float(model.speed(1.0))
    point = duty_point(gears.model(), speed)
    contact = "lose" if float(point.contact_loss_fraction) > 0.0 else "keep"
    return (
        "This analysis needs a stiffness that changes instantaneously (a rectangle). With --model "
        f"teeth, gears started in static equilibrium {contact} contact at {speed:.6g} rpm; their "
        f"dynamic factor is {float(point.dynamic_factor):.3f}."
    )


def _tuning_range(model, start, stop):
    """Convert the options `start` and `stop` to the first and the last tuning of a sweep.

    The tuning is the mesh frequency over the natural frequency of `model`. Both options are
    tunings, speeds such as "1500rpm", or None for the default tunings 0.5 and 1.4.
    """
    from gearlib.runs.run_arguments import check_tuning, tuning_at_speed

    ends = {"start": 0.5 if start is None else start, "stop": 1.4 if stop is None else stop}
    for name, end in ends.items():
        if isinstance(end, str):
            ends[name] = tuning_at_speed(model, name, speed_in_rpm(name, end))
        else:
            ends[name] = check_tuning(name, end)
    return ends["start"], ends["stop"]


def _select_maximum(dataset, values, dimension):
    """Return the dataset at the position along `dimension` where `values` has its maximum.

    `values` is an array over `dimension` and possibly "mesh"; the maximum over all meshes is used,
    and NaN is ignored.
    """
    values = values.max("mesh") if "mesh" in values.dims else values
    return dataset.isel({dimension: int(values.fillna(-math.inf).argmax(dimension))})


@gear_command("simulate", _RUN_OPTIONS, dimension="phase", motion="one speed")
def simulate(gears, model, tuning, samples, **run_options):
    """Run the gears at one speed: time history, contact events, orbit."""
    from gearlib.analysis.duty_point import si_variables
    from gearlib.data.result import make_result

    # `gears` is unused; `run_options` are the other options of the command.
    run_options |= {"tuning": tuning, "samples_per_period": samples}
    run = gearlib.simulate(model, **run_options)
    # If the period of the motion is longer than the record, record a whole period instead.
    if run_options["record_periods"] < int(run.period) <= run_options["periods"]:
        run = gearlib.simulate(model, **run_options | {"record_periods": int(run.period)})
    output.print_dataset(run)
    if not model.mesh_names:  # Only trains have names of meshes.
        variables = si_variables(run, model)
        variables = {name: value for name, value in variables.items() if name not in run}
        output.print_dataset(
            make_result("Duty point of a gear mesh", model, variables, method="run")
        )
    return run, lambda plot: plot.time_course(run)


@gear_command("sweep", f"start stop speed points direction {_SWEEP_OPTIONS}", "tuning")
def sweep(gears, model, start, stop, speed, points, direction, **run_options):
    """Run many tunings and compute the resonance curve.

    If the gears are given by their geometry, the default range includes --speed. With --direction
    down the range is extended to lower speeds until the motion has jumped down. The default of
    --model teeth is to sweep both up and down.
    """
    import numpy as np

    from gearlib.runs import run_arguments, sweeping

    # `run_options` are the other options; the direction "cold" starts each run from rest.
    both_ways = direction is None and gears.kind == "teeth"
    direction = direction or "cold"
    default_start = 0.1 if both_ways else None
    first, last = _tuning_range(model, default_start if start is None else start, stop)
    checks.require(first != last, "stop", stop, "different from start")
    is_default_range = gears.geometry and start is None and stop is None
    speed = speed_in_rpm("speed", speed)
    if is_default_range and (speed or gears.geometry.speed):
        tuning = run_arguments.tuning_at_speed(model, "speed", speed or gears.geometry.speed)
        first, last = min(first, tuning), max(last, tuning)
    grid = np.linspace(first, last, points)
    if both_ways:
        return _sweep_up_and_down(gears, model, grid, **run_options)
    if is_default_range and direction == "down":
        lowest = sweeping.EXTENSION_RATIO * first
        curve, jumped = sweeping.sweep_down(model, grid, lowest, **run_options)
        outcome = "jumped down above" if jumped else "did not jump down above"
        click.echo(f"The motion {outcome} {float(curve.speed[0]):.0f} rpm, the lowest speed.")
    else:
        curve = gearlib.sweep(model, grid, direction=direction, **run_options)
    failed = int((curve.status != 0).sum())
    # The first available variable is used. Displacements are the last choice, because they are
    # negative for meshes that carry their load on the coast side.
    names = ("dynamic_factor", "peak_force_ratio", "displacement_max")
    name = next(name for name in names if name in curve)
    words = name.replace("_max", "").replace("_", " ")
    click.echo(f"{curve.tuning.size} tunings, {failed} failed; maximum of the {words}:")
    output.print_dataset(_select_maximum(curve, curve[name], "tuning"))
    return curve, lambda plot: plot.resonance(curve)


def _sweep_up_and_down(gears, model, tunings, **run_options):
    """Sweep gears up and down in speed and print dynamic factor K_v and transmission error.

    `model` is the model of `gears`, `tunings` are mesh frequencies over the natural frequency, and
    `run_options` are arguments of `over_speed`. Return (dataset, function that plots it).
    """
    import numpy as np
    import pandas

    from gearlib.data import motions
    from gearlib.figures import gear_geometry_figure
    from gearlib.studies.teeth_over_speed import sweep_speeds

    curves = sweep_speeds(model, model.speed(np.sort(tunings)), gears.geometry.speed, **run_options)
    if not curves.get("complete", True):
        click.echo("The sweeps were stopped at the time limit --max-seconds.")
    # Only some of the speeds, evenly distributed, are printed.
    rows = np.unique(np.linspace(0, curves.tuning.size - 1, _MAX_TABLE_ROWS).round().astype(int))
    selected_speeds = curves.isel(tuning=rows)
    columns = {"rpm": selected_speeds.speed}
    for direction in selected_speeds.direction.values:
        curve = selected_speeds.sel(direction=direction)
        columns[f"K_v {direction}"] = curve.dynamic_factor
        columns[f"error {direction}, um"] = 1e6 * curve.error_peak_to_peak
    if "iso_dynamic_factor" in selected_speeds:
        columns["K_v ISO 6336"] = selected_speeds.iso_dynamic_factor
    table = pandas.DataFrame({name: column.values for name, column in columns.items()})
    output.print_table(table.set_index("rpm"))
    # The speed of a jump is NaN if there is no jump in the range.
    jumps = zip(curves.jump_up_speed.values, curves.jump_down_speed.values, strict=True)
    for up, down in jumps:
        jump_texts = []
        for direction, speed in (("up", up), ("down", down)):
            if math.isfinite(speed):
                jump_texts.append(f"at {speed:.0f} rpm going {direction}")
        if jump_texts:
            click.echo(f"The motion jumps {' and '.join(jump_texts)}.")
    click.echo(click.wrap_text(motions.describe_contact_loss(curves), output.WIDTH))
    return curves, lambda plot: gear_geometry_figure.draw_dynamic_factor(curves).axes[0]


@gear_command("run-up", f"start stop {_RUN_UP_OPTIONS}", "revolution")
def run_up(gears, model, start, stop, duration, acceleration, back, **run_options):
    """Run the gears up or down in speed: forces and contact loss over speed."""
    from gearlib.data.motions import largest_force
    from gearlib.runs.run_up import speed_course

    # `gears` is unused; `run_options` are initial_state, driver and max_seconds. A speed course is
    # a list of points (time in s, speed in rpm).
    start, stop = speed_in_rpm("start", start), speed_in_rpm("stop", stop)
    speed_points = speed_course(start, stop, duration, acceleration).tolist()
    if back:
        # The return to the first speed takes the same time.
        speed_points.append([2.0 * speed_points[-1][0], start])
    run = gearlib.run_up(model, speed=speed_points, **run_options)
    click.echo(f"{run.revolution.size} revolutions; the revolution with the largest force:")
    output.print_dataset(_select_maximum(run, largest_force(run), "revolution"))
    return run, lambda plot: plot.run_up(run)


@gear_command("orbit", "tuning speed period guess", "coordinate", motion="one speed")
def orbit(gears, model, tuning, **run_options):
    """Find a periodic orbit and its Floquet multipliers."""
    from gearlib.analysis.orbits.shooting import NoOrbit

    # `gears` is unused; `run_options` are the options period and guess.
    try:
        orbit = gearlib.periodic_orbit(model, tuning, **run_options)
    except NoOrbit as error:
        raise click.ClickException(str(error)) from None
    click.echo(f"{'stable' if orbit.stable else 'unstable'} orbit of period {orbit.period}")
    output.print_dataset(orbit.dataset())
    return orbit.dataset(), lambda plot: plot.orbit(orbit)


@gear_command("trust", "tuning speed initial_state periods max_seconds", "run", motion="one speed")
def trust(gears, model, tuning, **run_options):
    """Check by several runs whether chaos at one tuning is real or a numerical artefact."""
    # `gears` is unused; `run_options` are initial_state, periods and max_seconds.
    verdict = gearlib.trust(model, tuning, **run_options)
    click.echo(click.wrap_text(f"{verdict.label}: {verdict.message}", output.WIDTH))
    click.echo(f"Lyapunov exponent: {verdict.exponent:.6g} +- {verdict.uncertainty:.2g} per period")
    if verdict.label == "undecided":
        raise click.ClickException("undecided: see the message above for what to try")
    extrema = ("displacement_max", "displacement_min")
    return verdict.runs, lambda plot: plot.values(verdict.runs, *extrema)


@gear_command("modes", "", "mode", motion="none")
def modes(gears, train):
    """Compute the natural frequencies of the gear train and classify its modes."""
    # `gears` is unused; `train` is a `GearTrain`.
    modes = train.modes()
    output.print_dataset(modes)
    return modes, lambda plot: plot.values(modes, "natural_frequency")


@gear_command("static", "phase", "mesh", motion="none")
def static(gears, train, phase):
    """Compute the load sharing of the gear train at rest, including backlash and errors."""
    # `gears` is unused; `phase` is the mesh phase in rad at which the train is at rest.
    equilibrium = train.static(phase)
    output.print_dataset(equilibrium)
    return equilibrium, lambda plot: plot.values(equilibrium, "mesh_force")


@gear_command("phasing", "count", "stiffness_order", motion="none")
def phasing(gears, train, count):
    """Find the modes of a train excited by each harmonic of the mesh stiffness up to --count."""
    # `gears` is unused. A cell such as "2 of 3" of the printed table is the number of excited modes
    # of one kind.
    excitations = train.phasing(count)
    table = excitations[["excites", "mode_kind"]].to_dataframe()
    excites = table.groupby(["stiffness_order", "mode_kind"], sort=False).excites
    output.print_table(excites.agg(lambda values: f"{values.sum()} of {values.size}").unstack())
    return excitations, lambda plot: plot.values(excitations, "modal_force")


@gear_command("campbell", "count", "mode", motion="none")
def campbell(gears, train, count):
    """Compute the speeds (rpm) at which a mesh order, up to --count, excites a mode."""
    # `gears` is unused. Only excited modes are printed.
    diagram = train.campbell(count)
    table = diagram[["critical_speed", "natural_frequency", "mode_kind", "excites"]]
    table = table.to_dataframe().reset_index("stiffness_order")
    table = table[table.pop("excites").astype(bool)].set_index("critical_speed").sort_index()
    output.print_table(table)
    return diagram, lambda plot: plot.campbell(diagram)


@main.command(params=[*options.MODEL_OPTIONS, *options.command_options("frequencies", "speed")])
def frequencies(speed, **values):
    """Compute mesh, shaft, hunting tooth and planet frequencies at a speed of the pinion.

    The gears are those of the section `gears` or, with --model train, of the gear train.
    """
    import pandas

    from gearlib.analysis.characteristic_frequencies import frequency_rows

    # `values` are the options that describe the gears; no motion is computed.
    gears = pop_gears(values, needs_damping=False)
    speed = speed_in_rpm("speed", speed) or (gears.geometry and gears.geometry.speed)
    if speed is None:
        raise click.UsageError("--speed is missing: give it, as in --speed 1500rpm")
    if gears.kind != "train" and gears.geometry is None:
        raise click.UsageError("gears is missing: give the geometry of the gears, or --model train")
    model = gears.model() if gears.kind == "train" else gears.geometry.gear_stage()
    # The column "of" names the shaft, mesh or other component.
    header, *rows = frequency_rows(gearlib.characteristic_frequencies(model, float(speed)))
    output.print_table(pandas.DataFrame(rows, columns=header).set_index("of"))


@main.command(
    params=[
        click.Argument(["path"], metavar="FILE", type=options.FILE),
        *options.command_options("fmu", "output prescribed_speed speed force"),
    ]
)
def fmu(path, prescribed_speed, speed, force, **values):
    """Write the gear train in FILE, .yaml or .nc, as an FMU that runs without Python.

    The FMU is for Co-Simulation by FMI 3.0 and contains C sources and a binary for this machine.
    """
    # An argument called `output` would shadow the module.
    fmu_path = values["output"] or path.with_suffix(".fmu")
    output.check_path("--output", fmu_path, force, (".fmu",))
    speed = speed_in_rpm("speed", speed) or 0.0
    train = gearlib.read_train(path)
    gearlib.write_fmu(train, fmu_path, prescribed_speed=prescribed_speed, speed=speed)
    click.echo(f"written to {fmu_path}")


def _parse_tolerance(text):
    """Parse a string such as "load std=5%" to a configuration section `ToleratedParameter`.

    `text` has the name of a parameter and assignments, either of mean, std etc., or of
    `distribution` (the name of a distribution in scipy.stats) and its shape parameters.
    """
    name, *assignments = text.split() or [""]
    value_texts = dict(x.split("=") for x in assignments if x.count("=") == 1)
    # The dict is shorter than the list if a key is repeated or an assignment is malformed.
    is_complete = len(value_texts) == len(assignments) and all(value_texts.values())
    if not value_texts or not is_complete:
        raise click.UsageError(f"--tolerance {text!r} must have distinct keys, as in 'load std=5%'")
    values = {key: options.number_or_text(value) for key, value in value_texts.items()}
    # All other keys are shape parameters of the distribution.
    section = tolerances_section.ToleratedParameter
    shape = {key: values.pop(key) for key in values.keys() - section.model_fields.keys()}
    if shape and "distribution" not in values:
        known_keys = ", ".join(
            key for key in section.model_fields if key not in ("parameter", "shape")
        )
        raise click.UsageError(f"--tolerance {text!r} must only have the keys {known_keys}")
    # The values are validated later, when the unit of the parameter is known.
    return section.model_construct(parameter=name, shape=shape or None, **values)


@gear_command("scatter", f"{_SCATTER_OPTIONS} points seed max_seconds", "sample", rectangle=True)
def scatter(gears, model, quantity, samples, points, **run_options):
    """Compute how tolerances affect jumps, contact loss, peaks and the duty point."""
    import numpy as np
    import pandas

    from gearlib.figures import scatter_figure
    from gearlib.studies import tolerance_study
    from gearlib.uncertainty.scatter import refused

    # `run_options` are the other options. The tuning is mesh frequency over natural frequency. If
    # `points` is 0, the designs are not swept over tuning.
    first, last = _tuning_range(model, run_options.pop("start"), run_options.pop("stop"))
    run_options["tunings"] = np.linspace(first, last, points) if points else None
    run_options["speed"] = speed_in_rpm("speed", run_options["speed"])
    names = ("tolerance", "thickness_class", "distance_class", "quality")
    source, tolerances = _scatter_source_and_tolerances(gears, model, *map(run_options.pop, names))
    has_one_degree_of_freedom = model.size == 2  # the size of its state
    if has_one_degree_of_freedom:
        quantity = quantity or tolerances_section.Tolerances.model_fields["quantities"].default
        run_options["directions"] = ("up", "down", "seeded")
    designs = gearlib.scatter(source, tolerances, quantity, samples, **run_options)
    for text in refused(designs):
        click.echo(click.wrap_text(text, output.WIDTH))
    header, *rows = tolerance_study.table_rows(designs)
    table = pandas.DataFrame(rows, columns=header).replace({"unit": WRITTEN_UNITS})
    if rows:
        output.print_table(table.set_index("quantity"))
    if points:
        click.echo("Largest fraction of designs that lose contact, over all speeds:")
        output.print_table(designs.contact_loss_probability.max("speed").to_dataframe())
    draw = scatter_figure.draw_bands if points else scatter_figure.draw_quantities
    return designs, lambda plot: draw(designs).axes[0]


def _scatter_source_and_tolerances(
    gears, model, tolerance_texts, thickness_class, distance_class, quality
):
    """Return the arguments `source` and `tolerances` of `gearlib.scatter`.

    The source is a `StageDesign` if the geometry of `gears` has tolerances, else `model`.
    `tolerance_texts`, e.g. ["load std=5%"], replace the section `tolerances` of the configuration.
    `thickness_class` is one class of DIN 3967 or a string of two, e.g. "26cd 25cd";
    `distance_class` is a class of DIN 3964 and `quality` a class of ISO 1328-1. Classes that are
    not given are None.
    """
    thickness = None
    if thickness_class is not None:
        thickness = thickness_class.split()
        allowed = "one class of DIN 3967, such as 26cd, or one for each gear"
        checks.require(len(thickness) in (1, 2), "--thickness-class", thickness_class, allowed)
        thickness = (thickness * 2)[:2]
    section = gears.configuration.tolerances
    option_parameters = [_parse_tolerance(text) for text in tolerance_texts]
    has_section = not option_parameters and "tolerances" in gears.config_dict
    has_classes = any(x is not None for x in (thickness, distance_class, quality))
    if not (option_parameters or has_section or has_classes):
        raise click.UsageError("--tolerance is missing: give one, such as -t 'load std=5%'")
    tolerances, known_parameters = {}, tolerances_section.known_parameters()
    for toleranced in section.parameters if has_section else option_parameters:
        name = toleranced.parameter
        unit = known_parameters[name].numeric_unit if name in known_parameters else None
        tolerances[name] = toleranced.distribution_dict(f"tolerances.{name}", unit)
    geometry_only = tolerated.geometry_parameters().keys() - tolerated.pair_parameters().keys()
    needs_geometry = has_classes or bool(tolerances.keys() & geometry_only)
    if has_section and section.correlations:
        tolerances["correlations"] = [[*x.parameters, x.rho] for x in section.correlations]
    if not needs_geometry:
        return model, tolerances
    if gears.geometry is None:
        raise click.UsageError(
            "these tolerances need gears given by geometry, not --model six_degrees or train"
        )
    from gearlib.studies.tolerance_study import build_nominal_design
    from gearlib.uncertainty.quality_classes import by_class

    # With a thickness class, the backlash follows from the tooth thicknesses.
    stage = gears.geometry.geometry_dict() | ({"backlash": None} if thickness else {})
    for gear in ("pinion", "wheel") if quality else ():
        stage[gear] = stage[gear] | {"quality": quality}
    source = build_nominal_design(model.as_dict(), stage)
    # The profile form varies only if a quality class is given.
    classes = {"thickness": thickness, "centre_distance": distance_class, "form": bool(quality)}
    return source, by_class(source.stage, **classes) | tolerances


def _prepare_fit(values):
    """Convert the option `values` of the command `fit` in place.

    The entry `path`, a YAML file, is replaced by `data`, the measured data set that it describes.
    The entry `free`, a list of NAME or NAME=LOW,HIGH, is replaced by a dict of parameter ranges in
    SI units. Gear parameters and the model are taken from the file unless options give them.
    """
    path = values.pop("path")
    values["data"] = data = gearlib.read_measured(path)
    section = measured_description.read_description(path).fit or measured_description.FitSection()
    ranges = {} if values["free"] else dict(section.free)
    for text in values["free"]:
        name, equals, limits = text.partition("=")
        checks.require(name, "--free", text, "NAME or NAME=LOW,HIGH")
        ranges[name] = limits.split(",") if equals else section.free.get(name, [])
    if not ranges:
        raise click.UsageError(f"--free is missing: give NAME=LOW,HIGH, or fit.free in {path}")
    values["free"] = {name: measured_description.free_range(name, x) for name, x in ranges.items()}
    known = json.loads(data.attrs["known"])
    if values["config"] is None and not DEFAULT_CONFIG.exists():
        # Without a configuration, the fit starts from the middle of each range.
        known = {name: sum(limits) / 2.0 for name, limits in values["free"].items()} | known
    # Options take precedence over the values in the file.
    for name in (*GearPairSection.model_fields, *DAMPINGS):
        if values[name] is None and isinstance(known.get(name), int | float):
            values[name] = known[name]
    values["model"] = values["model"] or section.model
    # The model "pair" is called "rectangle" on the command line.
    if values["model"] == "pair":
        values["model"] = "rectangle"


@gear_command(
    *("fit", "free", "parameter"), arguments=[_DATA_ARGUMENT], prepare=_prepare_fit, rectangle=True
)
def fit(gears, model, data, free):
    """Fit parameters of the gears to the measured data that the YAML file DATA describes."""
    # `gears` is unused; `free` maps each parameter to its range (lower limit, upper limit).
    text = f"{data.title}{', synthetic' if data.synthetic else ''}: {data.source}"
    repairs = f"; repairs: {data.attrs['repairs']}" if data.attrs["repairs"] else ""
    click.echo(click.wrap_text(text + repairs, output.WIDTH))
    fitted = gearlib.fit(model, data, free)
    click.echo(str(fitted))
    return fitted.dataset(), lambda plot: plot.fit(fitted)


@main.command(params=options.STAGE_OPTIONS + options.command_options("", "format save plot force"))
def gears(format, save, plot, force, **values):
    """Print geometry, mesh stiffness by each method, and resonance speed of two gears.

    The gears are given by their geometry. With a speed and a damping, the table includes the motion
    at this speed (the duty point).
    """
    from gearlib.studies import gear_table

    output.check_path("--save", save, force, options.YAML)
    output.check_path("--plot", plot, force, options.PICTURES)
    # A configuration that is saved must have a damping.
    gears = pop_gears(values, needs_damping=bool(save), needs_geometry=True)
    if save:
        import yaml

        text = yaml.safe_dump(gears.config_dict, sort_keys=False, allow_unicode=True)
        output.write_text(save, text)
    section = gears.configuration.gears
    damping = gears.configuration.dampings[gears.damping].configured_values()
    # The table has every stiffness method, but the options are for the configured method.
    options_by_method = {section.stiffness or "iso": section.stiffness_options}
    load = section.load_arguments() | {"damping": damping}
    rows = gear_table.gear_quantities(section.gear_stage(), options=options_by_method, **load)
    if section.speed and gears.damping != NO_DAMPING:
        model = gears.model()
        point = section.speed, section.driving_torque()
        rows += gear_table.duty_point_rows(model, *point, gears.stiffness(model))
    if format == "text":
        click.echo(gears.name)
    output.print_gear_table(rows, format)
    if section.speed and gears.damping == NO_DAMPING:
        click.echo("The duty point needs a damping: give --damping-ratio.", err=True)
    if plot:
        from gearlib.figures import gear_geometry_figure
        from gearlib.studies.gear_geometry import mesh_stiffness

        # A `PublishedPair` also has published values; there are none here.
        pair_dict = section.model_dump() | {"torque": section.driving_torque(), "published": {}}
        curves = mesh_stiffness({"mesh stiffness": pair_dict}, samples=_STIFFNESS_CURVE_SAMPLES)
        output.save_picture(
            plot, gears.name, lambda _: gear_geometry_figure.draw_mesh_stiffness(curves)
        )
    # The row "settled" states for each stiffness method whether the motion is periodic.
    if any(row.name == "settled" and not all(row.values.values()) for row in rows):
        raise click.ClickException("the motion at the duty point has not settled")


@main.command(params=options.PAIR_OPTIONS + options.command_options("explore", "port"))
@click.option("--show/--no-show", default=True, help="Open a browser.")
def explore(port, show, **values):
    """Explore a gear pair with sliders in the browser."""
    from gearlib.explorer import page

    # `values` are the options that describe the gears. Port 0 selects any free port.
    gears = pop_gears(values)
    page.serve(gears.config_dict, gears.damping, port or 0, show)


@main.command()
def schema():
    """Print the JSON schema of the configuration, for editors."""
    click.echo(schema_text(), nl=False)


_FOLDER = click.Path(file_okay=False, path_type=Path)


@main.command()
@click.argument("folder", type=_FOLDER)
@click.option("--gearbox", type=options.FILE, help="REXS file of a gearbox, copied into FOLDER.")
def init(folder, gearbox):
    """Start a project: write a template configuration to FOLDER/config.yaml.

    `gearlib workflow -j2`, called in FOLDER, computes its targets in FOLDER/results. With
    --gearbox the targets are all stages and load cases of the gearbox and the whole gearbox.
    """
    from gearlib.config import new_project

    # An existing project is never overwritten.
    path = folder / DEFAULT_CONFIG
    if path.exists():
        raise click.UsageError(f"{path} exists: choose another folder")
    text = new_project.TEXT
    if gearbox:
        gearlib.read_gearbox(gearbox)  # raises an error if the file is invalid
        if (folder / gearbox.name).exists():
            raise click.UsageError(f"{folder / gearbox.name} exists: choose another folder")
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(gearbox, folder / gearbox.name)
        text = new_project.GEARBOX_TEXT.format(file=json.dumps(gearbox.name, ensure_ascii=False))
    output.write_text(path, text)


@main.command(params=[click.Argument(["path"], metavar="FILE", type=options.FILE)])
@click.option("--report", type=options.FILE, help="HTML report of tables and figures to write.")
@click.option("--force", is_flag=True, help="Replace an existing page.")
def gearbox(path, report, force):
    """Print stages and loads of the gearbox in a REXS FILE: .rexs, .rexsj, .rexsz or .rexs.zip.

    The report has figures, sweeps of each stage over speed, and the modes of the whole gearbox.
    """
    # Check the path first, because computing the report may take minutes.
    output.check_path("--report", report, force, (".html",))
    box = gearlib.read_gearbox(path)
    click.echo(box)
    if report:
        from gearlib.cli import gearbox_report

        output.write_text(report, gearbox_report.page(path, str(box)))


@main.command()
@click.argument("folder", type=_FOLDER, default="paper")
@click.option(
    "-j", "--jobs", default=2, type=click.IntRange(1), show_default=True, help="Parallel processes."
)
@click.option("--all", "everything", is_flag=True, help="Compute all targets.")
def paper(folder, jobs, everything):
    """Reproduce the figures of the paper and check its claims in FOLDER, by default ./paper.

    Results are written to FOLDER/results. An existing FOLDER/config.yaml is used unchanged.
    """
    # The package contains the configuration of the paper; "all" and "paper" are Snakemake rules.
    path = folder / DEFAULT_CONFIG
    if not path.exists():
        output.write_text(path, (_WORKFLOW_ROOT / DEFAULT_CONFIG).read_text("utf-8"))
    _run_snakemake(folder, [f"-j{jobs}", "all" if everything else "paper"])


@main.command(params=[click.Argument(["folders"], nargs=-1, required=True, type=_FOLDER)])
@click.option(
    "-o", "--output", "picture", type=options.FILE, help="Picture to draw, e.g. curve.png."
)
@click.option("--force", is_flag=True, help="Replace an existing picture.")
def compare(folders, picture, force):
    """Compare projects: print their gears side by side and plot their resonance curves.

    Each FOLDER must contain results/resonance.nc, computed by `gearlib workflow -j2 resonance`.
    """
    import pandas

    from gearlib.data import storage

    output.check_path("--output", picture, force, options.PICTURES)
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise click.UsageError(f"FOLDER {' '.join(names)}: the names of the folders must differ")
    # The table has one column per project, a dict of quantity names and values.
    curves, columns = [], {}
    for name, folder in zip(names, folders, strict=True):
        path = folder / "results/resonance.nc"
        allowed = "a folder with results/resonance.nc, computed by `gearlib workflow -j2 resonance`"
        checks.require(path.is_file(), "FOLDER", str(folder), allowed)
        curves.append(storage.read(path))
        scalars = [value for value in curves[-1].data_vars.values() if not value.ndim]
        rows = [(x.name, "", WRITTEN_UNITS.get(x.units, x.units), float(x)) for x in scalars]
        # If the gears are given by their geometry, their table has more quantities.
        table_path = path.with_name("gears.csv")
        if table_path.is_file():
            cells = pandas.read_csv(table_path, keep_default_na=False)
            rows = cells[["name", "of", "unit", "value"]].values.tolist()
        columns[name] = {" ".join(filter(None, label)): value for *label, value in rows}
    output.print_table(pandas.DataFrame(columns))
    if picture:
        from gearlib.figures import resonance_figure, style

        style.save(resonance_figure.draw_cases(curves, names), picture)
        click.echo(f"plotted to {picture}")


@main.command(context_settings={"ignore_unknown_options": True, "help_option_names": ["-h"]})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def workflow(arguments):
    """Run the Snakemake workflow of this package in the current folder.

    ARGUMENTS are passed to Snakemake, as in `gearlib workflow -j2 --configfile mine.yaml`. As in
    the other commands, --config mine.yaml selects a configuration file, too.
    """
    arguments = list(arguments) or ["-j2"]
    for i, (argument, next_argument) in enumerate(
        zip(arguments, [*arguments[1:], ""], strict=True)
    ):
        # Snakemake's own option --config takes KEY=VALUE pairs.
        if argument == "--config" and "=" not in next_argument:
            arguments[i] = "--configfile"
    # Split "--configfile=mine.yaml" into the option and its value.
    parts = [part for x in arguments for part in re.split("(?<=^--configfile)=", x)]
    is_config_file = False
    for argument in parts:
        if argument.startswith("-"):
            is_config_file = argument in ("--configfile", "--configfiles")
        elif is_config_file:
            # Unlike Snakemake, these checks report a missing file and the line of an error.
            allowed = "a file; put targets before this option"
            checks.require(Path(argument).is_file(), "--configfile", argument, allowed)
            validation.read_yaml(argument)
    _run_snakemake(Path(), arguments)


def _run_snakemake(folder, arguments):
    """Run Snakemake in `folder` with the rules of this package, and exit with its exit code.

    `arguments` is a list of command-line arguments, e.g. ["-j2", "all"].
    """
    if find_spec("snakemake") is None:
        raise ModuleNotFoundError("Snakemake is not installed", name="snakemake")
    command = [sys.executable, "-m", "snakemake", "--snakefile", _WORKFLOW_ROOT / "Snakefile"]
    command += ["--workflow-profile", _WORKFLOW_ROOT / "profiles/default", "--directory", folder]
    command += ["--report-stylesheet", _WORKFLOW_ROOT / "workflow/report/report.css", *arguments]
    # Output to a pipe is copied line by line, so that closing the pipe does not stop Snakemake.
    # `sys.__stdout__` is None if standard output (file descriptor 1) is closed.
    is_pipe = sys.__stdout__ is not None and not os.isatty(1)
    process = subprocess.Popen(command, stdout=subprocess.PIPE if is_pipe else None)
    # Snakemake handles Ctrl-C itself and stops its jobs first.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        for line in process.stdout or ():
            os.write(1, line)
    finally:
        # If the reader of the output exits, as `| head` does, Snakemake still finishes.
        process.communicate()
    sys.exit(process.returncode)
