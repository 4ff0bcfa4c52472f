"""The commands: each calls the library, prints the results and draws them."""

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
from gearlib.cli.gears import DEFAULT_CONFIG, NO_DAMPING, in_rpm, take_gears
from gearlib.config import measured_description, schema_text, tolerances_section, validation
from gearlib.config.gear_pair_section import DAMPINGS, GearPairSection
from gearlib.models import tolerated
from gearlib.units import WRITTEN_UNITS

#: Folder of the Snakefile, in the installed package or in a checkout.
_INSTALLED = Path(__file__).parents[1] / "installed_workflow"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2]
#: Options of `simulate`, `sweep` and `scatter`, and the argument of `fit`.
_RUN = "tuning speed initial_state periods record_periods samples method until_settled"
_RUN_UP = "duration acceleration back initial_state driver max_seconds"
_SWEEP = "periods record_periods method max_seconds"
_SCATTER = "tolerance thickness_class distance_class quality quantity samples speed start stop"
_DATA = click.Argument(["path"], metavar="DATA", type=options.FILE)
_SPEEDS_IN_TABLE = 14  #: number of speeds in the table of a sweep up and down
_CURVE_PHASES = 257  #: number of mesh phases of the curve of the mesh stiffness


@click.group(
    cls=options.Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 success; 1 the computation failed; 2 wrong input.",
)
@click.version_option(gearlib.__version__, prog_name="gearlib")
def main():
    """Nonlinear dynamics of gear meshes.

    A configuration (--config, --damping), options, or both describe the gears; options take
    precedence. Values may have units, as in --backlash "40 um". The section `train` describes the
    gear train for --model train and for the commands modes, static, phasing and campbell.
    """


def gear_command(
    name, option_names, dimension, motion="sweep", arguments=(), prepare=None, rectangle=False
):
    """Return a decorator that turns a function into the command `name`.

    It calls the function with `Gears`, their model and the option values; the function returns a
    dataset and a function that draws it with `gearlib.plot`. `option_names` is a string of names
    separated by spaces, `arguments` are additional click parameters, and `prepare` may change the
    dict of option values in place. A written table has one row per entry of `dimension`. `motion`
    is "one speed", "sweep" or, for gear trains at rest, "none". If `rectangle` is true, a mesh
    stiffness that alternates between two values replaces the model of single pairs of teeth.
    """

    def run(function, values):
        """Take the gears from the option `values`, call `function`, write and draw its result."""
        from gearlib.runs.run_arguments import tuning_of

        data_path, plot_path, force = (values.pop(key) for key in ("output", "plot", "force"))
        output.check("--output", data_path, force, options.DATA)
        output.check("--plot", plot_path, force, options.PICTURES)
        if prepare:
            prepare(values)
        if motion == "none":
            values["model"] = "train"
        configured_gears = take_gears(values, moves=motion != "none")
        gears = configured_gears.rectangle() if rectangle else configured_gears
        section = configured_gears.settings.gears
        # Whole cycles of pitch errors are too long for each speed of a sweep.
        model = gears.model(pitch_errors=motion != "sweep")
        description = gears.description(model)
        if motion == "one speed":
            # Without --speed and --tuning the speed of the section `gears` is used.
            speed = values.pop("speed")
            if speed is None and values["tuning"] is None and section:
                speed = section.speed
            values["tuning"] = tuning_of(model, values["tuning"], in_rpm("speed", speed))
        if name in ("simulate", "sweep", "trust") and not values.get("initial_state"):
            values["initial_state"] = "static" if gears.kind == "teeth" else (0.0, 0.0)
        click.echo(click.wrap_text(description, output.WIDTH))
        notes = [model.force_note] if motion != "none" and section else []
        if gears.kind == "teeth" and motion == "sweep" and section.modification_key("pitch_errors"):
            notes.append("Pitch errors are left out: `gearlib simulate` has them, at one speed.")
        if gears is not configured_gears:
            speed = in_rpm("speed", values.get("speed"))
            notes.append(_note_on_teeth(configured_gears, model, speed))
        for note in filter(None, notes):
            click.echo(click.wrap_text(note, output.WIDTH))
        dataset, draw = function(gears, model, **values)
        if "stiffness_model" in dataset.attrs:
            dataset.attrs["stiffness_model"] = gears.stiffness(model)
        if data_path:
            output.write(data_path, dataset, dimension)
        if plot_path:
            output.save_picture(plot_path, description, draw, model, dataset)

    parameters = [*arguments, *(options.PAIR if motion == "none" else options.MODEL)]
    parameters += options.command_options(name, f"{option_names} output plot force")
    return lambda function: main.command(name, params=parameters, help=function.__doc__)(
        lambda **values: run(function, values)
    )


def _note_on_teeth(gears, model, speed):
    """Return a sentence on the motion of pairs of teeth, for an analysis of a simpler model.

    `gears` are `Gears` whose pairs of teeth deform by themselves. `model` is the simpler model that
    is analysed, a mesh stiffness that alternates between two values (a rectangle over time). The
    sentence states contact loss and dynamic factor of `gears` at the `speed` in rpm. With None it
    is the speed of the gears or, if they have none, the resonance speed of the model.
    """
    from gearlib.analysis.duty_point import duty_point

    # The tuning, mesh frequency over natural frequency, is 1 at resonance.
    speed = speed or gears.geometry.speed or float(model.speed(1.0))
    point = duty_point(gears.model(), speed)
    contact = "lose" if float(point.contact_loss_fraction) > 0.0 else "keep"
    return (
        "This analysis needs a rectangular stiffness, which changes all at once. Pairs of teeth "
        f"that start in static equilibrium {contact} contact at {speed:.6g} rpm; their dynamic "
        f"factor is {float(point.dynamic_factor):.3f}."
    )


def _tuning_range(model, start, stop):
    """Return the first and last tuning of a sweep from the options `start` and `stop`.

    The tuning is mesh frequency over natural frequency of `model`. Both options are tunings, speeds
    such as "1500rpm", or None for the default tunings 0.5 and 1.4.
    """
    from gearlib.runs.run_arguments import check_tuning, tuning_at_speed

    ends = {"start": 0.5 if start is None else start, "stop": 1.4 if stop is None else stop}
    for name, end in ends.items():
        if isinstance(end, str):
            ends[name] = tuning_at_speed(model, name, in_rpm(name, end))
        else:
            ends[name] = check_tuning(name, end)
    return ends["start"], ends["stop"]


def _at_largest(dataset, values, dimension):
    """Return the dataset at the position along `dimension` where an array is largest.

    The array `values` belongs to the dataset and may contain NaN. If it has the dimension "mesh",
    the largest value over all meshes counts.
    """
    values = values.max("mesh") if "mesh" in values.dims else values
    return dataset.isel({dimension: int(values.fillna(-math.inf).argmax(dimension))})


@gear_command("simulate", _RUN, dimension="phase", motion="one speed")
def simulate(gears, model, tuning, samples, **settings):
    """Run the gears at one speed: time history, contact events, orbit."""
    from gearlib.analysis.duty_point import si_variables
    from gearlib.data.result import result

    # `gears` are not needed; `settings` are the other options in _RUN, arguments of the library.
    settings |= {"tuning": tuning, "samples_per_period": samples}
    run = gearlib.simulate(model, **settings)
    # If the motion repeats after more mesh periods than were recorded, record its whole period.
    if settings["record_periods"] < int(run.period) <= settings["periods"]:
        run = gearlib.simulate(model, **settings | {"record_periods": int(run.period)})
    output.show(run)
    if not model.mesh_names:  # Only trains have names of meshes.
        variables = si_variables(run, model)
        variables = {name: value for name, value in variables.items() if name not in run}
        output.show(result("Duty point of a gear mesh", model, variables, method="run"))
    return run, lambda plot: plot.time_course(run)


@gear_command("sweep", f"start stop speed points direction {_SWEEP}", "tuning")
def sweep(gears, model, start, stop, speed, points, direction, **settings):
    """Run many tunings: the resonance characteristic.

    The default range of gears given by geometry includes their --speed. With --direction down it
    extends downwards until the motion has jumped down. Pairs of teeth are swept up and down, unless
    a direction is given.
    """
    import numpy as np

    from gearlib.runs import run_arguments, sweeping

    # `settings` are the other options in _SWEEP. The direction "cold" starts each run from rest.
    both_ways = direction is None and gears.kind == "teeth"
    direction = direction or "cold"
    default_start = 0.1 if both_ways else None
    first, last = _tuning_range(model, default_start if start is None else start, stop)
    checks.require(first != last, "stop", stop, "another tuning than start")
    is_default_range = gears.geometry and start is None and stop is None
    speed = in_rpm("speed", speed)
    if is_default_range and (speed or gears.geometry.speed):
        tuning = run_arguments.tuning_at_speed(model, "speed", speed or gears.geometry.speed)
        first, last = min(first, tuning), max(last, tuning)
    grid = np.linspace(first, last, points)
    if both_ways:
        return _sweep_up_and_down(gears, model, grid, **settings)
    if is_default_range and direction == "down":
        lowest = sweeping.EXTENSION_RATIO * first
        curve, jumped = sweeping.sweep_down(model, grid, lowest, **settings)
        jump = "has jumped down above" if jumped else "has not jumped down at"
        click.echo(f"The motion {jump} {float(curve.speed[0]):.0f} rpm, the lowest speed.")
    else:
        curve = gearlib.sweep(model, grid, direction=direction, **settings)
    failed = int((curve.status != 0).sum())
    # Use the first of these that the dataset has. The displacement is the last choice, because it
    # is negative for meshes that carry their load on the coast side.
    names = ("dynamic_factor", "peak_force_ratio", "displacement_max")
    name = next(name for name in names if name in curve)
    text = name.replace("_max", "").replace("_", " ")
    click.echo(f"{curve.tuning.size} tunings, {failed} failed; at the largest {text}:")
    output.show(_at_largest(curve, curve[name], "tuning"))
    return curve, lambda plot: plot.resonance(curve)


def _sweep_up_and_down(gears, model, tunings, **settings):
    """Sweep pairs of teeth upward and downward in speed, and print a table of the results.

    The table has dynamic factor K_v and transmission error over the speed. `model` is the model of
    `gears`, and `tunings` are mesh frequencies over natural frequency. `settings` are arguments of
    `over_speed`, such as periods. Return (dataset, function that plots it).
    """
    import numpy as np
    import pandas

    from gearlib.data import motions
    from gearlib.figures import gear_geometry_figure
    from gearlib.studies.teeth_over_speed import over_speed

    curves = over_speed(model, model.speed(np.sort(tunings)), gears.geometry.speed, **settings)
    if not curves.get("complete", True):
        click.echo("The sweeps were stopped after --max-seconds.")
    # The table has some of the speeds, evenly distributed.
    rows = np.unique(np.linspace(0, curves.tuning.size - 1, _SPEEDS_IN_TABLE).round().astype(int))
    selected_speeds = curves.isel(tuning=rows)
    columns = {"rpm": selected_speeds.speed}
    for direction in selected_speeds.direction.values:
        curve = selected_speeds.sel(direction=direction)
        columns[f"K_v {direction}"] = curve.dynamic_factor
        columns[f"error {direction}, um"] = 1e6 * curve.error_peak_to_peak
    if "iso_dynamic_factor" in selected_speeds:
        columns["K_v ISO 6336"] = selected_speeds.iso_dynamic_factor
    output.frame(pandas.DataFrame({name: x.values for name, x in columns.items()}).set_index("rpm"))
    # A speed of a jump is NaN if it lies outside the range.
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


@gear_command("run-up", f"start stop {_RUN_UP}", "revolution")
def run_up(gears, model, start, stop, duration, acceleration, back, **settings):
    """Run the gears up or down: forces and contact losses over the speed."""
    from gearlib.data.motions import largest_force
    from gearlib.runs.run_up import speed_course

    # `gears` are not needed; `settings` are initial_state, driver and max_seconds. A speed course
    # is a list of points (time in s, speed in rpm).
    start, stop = in_rpm("start", start), in_rpm("stop", stop)
    speed_points = speed_course(start, stop, duration, acceleration).tolist()
    if back:
        # The way back to the first speed takes the same time.
        speed_points.append([2.0 * speed_points[-1][0], start])
    run = gearlib.run_up(model, speed=speed_points, **settings)
    click.echo(f"{run.revolution.size} revolutions; the revolution of the largest force:")
    output.show(_at_largest(run, largest_force(run), "revolution"))
    return run, lambda plot: plot.run_up(run)


@gear_command("orbit", "tuning speed period guess", "coordinate", motion="one speed")
def orbit(gears, model, tuning, **settings):
    """Find a periodic orbit and its Floquet multipliers."""
    from gearlib.analysis.orbits.shooting import NoOrbit

    # `gears` are not needed; `settings` are the options period and guess.
    try:
        orbit = gearlib.periodic_orbit(model, tuning, **settings)
    except NoOrbit as error:
        raise click.ClickException(str(error)) from None
    click.echo(f"{'stable' if orbit.stable else 'unstable'} orbit of period {orbit.period}")
    output.show(orbit.dataset())
    return orbit.dataset(), lambda plot: plot.orbit(orbit)


@gear_command("trust", "tuning speed initial_state periods max_seconds", "run", motion="one speed")
def trust(gears, model, tuning, **settings):
    """Check whether chaos at one tuning is real or a numerical artefact, by several runs."""
    # `gears` are not needed; `settings` are initial_state, periods and max_seconds.
    verdict = gearlib.trust(model, tuning, **settings)
    click.echo(click.wrap_text(f"{verdict.label}: {verdict.message}", output.WIDTH))
    click.echo(f"Lyapunov exponent: {verdict.exponent:.6g} +- {verdict.uncertainty:.2g} per period")
    if verdict.label == "undecided":
        raise click.ClickException("undecided: the message above says what to try")
    extrema = ("displacement_max", "displacement_min")
    return verdict.runs, lambda plot: plot.values(verdict.runs, *extrema)


@gear_command("modes", "", "mode", motion="none")
def modes(gears, train):
    """Compute the natural frequencies of the gear train, and the kinds of its modes."""
    # The first argument, the `Gears` of the command line, is not needed for the `GearTrain`.
    modes = train.modes()
    output.show(modes)
    return modes, lambda plot: plot.values(modes, "natural_frequency")


@gear_command("static", "phase", "mesh", motion="none")
def static(gears, train, phase):
    """Compute the load sharing of the gear train at rest, with gaps and errors."""
    # `gears` are not needed; `phase` is the mesh phase in rad at which the `GearTrain` rests.
    equilibrium = train.static(phase)
    output.show(equilibrium)
    return equilibrium, lambda plot: plot.values(equilibrium, "mesh_force")


@gear_command("phasing", "count", "stiffness_order", motion="none")
def phasing(gears, train, count):
    """Find which harmonics of the mesh stiffness, up to --count, excite which modes of a train."""
    # `gears` are not needed; `train` is a `GearTrain`, `count` the highest stiffness harmonic. A
    # cell of the table, such as "2 of 3", counts the excited modes of a kind.
    excitations = train.phasing(count)
    table = excitations[["excites", "mode_kind"]].to_dataframe()
    excites = table.groupby(["stiffness_order", "mode_kind"], sort=False).excites
    output.frame(excites.agg(lambda values: f"{values.sum()} of {values.size}").unstack())
    return excitations, lambda plot: plot.values(excitations, "modal_force")


@gear_command("campbell", "count", "mode", motion="none")
def campbell(gears, train, count):
    """Compute the speeds, rpm, at which mesh frequencies excite a mode, up to the order --count."""
    # `gears` are not needed; `train` is a `GearTrain`. The table lists the excited modes only.
    diagram = train.campbell(count)
    table = diagram[["critical_speed", "natural_frequency", "mode_kind", "excites"]]
    table = table.to_dataframe().reset_index("stiffness_order")
    table = table[table.pop("excites").astype(bool)].set_index("critical_speed").sort_index()
    output.frame(table)
    return diagram, lambda plot: plot.campbell(diagram)


@main.command(params=[*options.MODEL, *options.command_options("frequencies", "speed")])
def frequencies(speed, **values):
    """Compute mesh, shaft, hunting tooth and planet frequencies at a speed of the pinion.

    They belong to the gears of the section `gears` or, with --model train, to the gear train.
    """
    import pandas

    from gearlib.analysis.characteristic_frequencies import frequency_rows

    # `values` are the options that describe the gears, which need no damping here.
    gears = take_gears(values, moves=False)
    speed = in_rpm("speed", speed) or (gears.geometry and gears.geometry.speed)
    if speed is None:
        raise click.UsageError("--speed is missing: it must be given, as in --speed 1500rpm")
    if gears.kind != "train" and gears.geometry is None:
        raise click.UsageError("gears is missing: give their geometry, or --model train")
    model = gears.model() if gears.kind == "train" else gears.geometry.mesh()
    # The column "of" has the name of the shaft, mesh or other part with the frequency.
    header, *rows = frequency_rows(gearlib.characteristic_frequencies(model, float(speed)))
    output.frame(pandas.DataFrame(rows, columns=header).set_index("of"))


@main.command(
    params=[
        click.Argument(["path"], metavar="FILE", type=options.FILE),
        *options.command_options("fmu", "output prescribed_speed speed force"),
    ]
)
def fmu(path, prescribed_speed, speed, force, **values):
    """Write the gear train of FILE, .yaml or .nc, as an FMU that needs no Python.

    It is for Co-Simulation with FMI 3.0, and contains C sources and a binary for this machine.
    """
    # The option --output stays in `values`, since an argument `output` would hide the module.
    written = values["output"] or path.with_suffix(".fmu")
    output.check("--output", written, force, (".fmu",))
    settings = {"prescribed_speed": prescribed_speed, "speed": in_rpm("speed", speed) or 0.0}
    gearlib.write_fmu(gearlib.read_train(path), written, **settings)
    click.echo(f"written to {written}")


def _tolerance(text):
    """Return the section `ToleratedParameter` for a string such as "load std=5%".

    The string `text` has the name of a parameter, then assignments of mean, std and the like, or of
    `distribution` (a name in scipy.stats) and its shape parameters.
    """
    name, *assignments = text.split() or [""]
    value_texts = dict(x.split("=") for x in assignments if x.count("=") == 1)
    # Repeated keys, and assignments without a single "=", leave fewer texts than assignments.
    is_complete = len(value_texts) == len(assignments) and all(value_texts.values())
    if not value_texts or not is_complete:
        raise click.UsageError(f"--tolerance {text!r} must have keys, each once, as 'load std=5%'")
    values = {key: options.number_or_text(value) for key, value in value_texts.items()}
    # Unknown keys are parameters of a distribution.
    section = tolerances_section.ToleratedParameter
    shape = {key: values.pop(key) for key in values.keys() - section.model_fields.keys()}
    if shape and "distribution" not in values:
        known_keys = ", ".join(
            key for key in section.model_fields if key not in ("parameter", "shape")
        )
        raise click.UsageError(f"--tolerance {text!r} must have keys of {known_keys}")
    # The values are checked later, when the unit of the parameter is known.
    return section.model_construct(parameter=name, shape=shape or None, **values)


@gear_command("scatter", f"{_SCATTER} points seed max_seconds", "sample", rectangle=True)
def scatter(gears, model, quantity, samples, points, **settings):
    """Compute the effect of tolerances on jumps, contact loss, peaks and the duty point."""
    import numpy as np
    import pandas

    from gearlib.figures import scatter_figure
    from gearlib.studies import tolerance_study
    from gearlib.uncertainty.scatter import refused

    # `settings` are the other options in _SCATTER. Tunings are mesh over natural frequencies; with
    # `points` 0 no sweep is computed for the designs.
    first, last = _tuning_range(model, settings.pop("start"), settings.pop("stop"))
    settings["tunings"] = np.linspace(first, last, points) if points else None
    settings["speed"] = in_rpm("speed", settings["speed"])
    names = ("tolerance", "thickness_class", "distance_class", "quality")
    source, tolerances = _source_and_tolerances(gears, model, *map(settings.pop, names))
    # A model with two state variables has one degree of freedom.
    if model.size == 2:
        quantity = quantity or tolerances_section.Tolerances.model_fields["quantities"].default
        settings["directions"] = ("up", "down", "seeded")
    designs = gearlib.scatter(source, tolerances, quantity, samples, **settings)
    for text in refused(designs):
        click.echo(click.wrap_text(text, output.WIDTH))
    header, *rows = tolerance_study.rows(designs)
    table = pandas.DataFrame(rows, columns=header).replace({"unit": WRITTEN_UNITS})
    if rows:
        output.frame(table.set_index("quantity"))
    if points:
        click.echo("Largest share of the designs that lose contact at a speed:")
        output.frame(designs.contact_loss_probability.max("speed").to_dataframe())
    # With sweeps the figure shows bands over the speed, else the distributions of the quantities.
    draw = scatter_figure.draw_bands if points else scatter_figure.draw_quantities
    return designs, lambda plot: draw(designs).axes[0]


def _source_and_tolerances(gears, model, tolerance_texts, thickness_class, distance_class, quality):
    """Return the arguments `source` and `tolerances` of `gearlib.scatter`.

    The source is `model`, or a `StageDesign` if the geometry of `gears` has tolerances.
    `tolerance_texts`, such as ["load std=5%"], replace the section `tolerances`. `thickness_class`
    is a class of DIN 3967, or two as in "26cd 25cd"; `distance_class` is a class of DIN 3964,
    `quality` a class of ISO 1328-1. None means no class.
    """
    thickness = None
    if thickness_class is not None:
        thickness = thickness_class.split()
        allowed = "one class of DIN 3967 for both gears such as 26cd, or two"
        checks.require(len(thickness) in (1, 2), "--thickness-class", thickness_class, allowed)
        thickness = (thickness * 2)[:2]
    section = gears.settings.tolerances
    option_parameters = list(map(_tolerance, tolerance_texts))
    has_section = not option_parameters and "tolerances" in gears.mapping
    has_classes = any(x is not None for x in (thickness, distance_class, quality))
    if not (option_parameters or has_section or has_classes):
        raise click.UsageError("--tolerance is missing: give one, such as -t 'load std=5%'")
    tolerances, known_parameters = {}, tolerances_section.known_parameters()
    for toleranced in section.parameters if has_section else option_parameters:
        name = toleranced.parameter
        unit = known_parameters[name].number if name in known_parameters else None
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
    from gearlib.studies.tolerance_study import nominal_design
    from gearlib.uncertainty.quality_classes import by_class

    # The backlash follows from the thickness of the teeth.
    stage = gears.geometry.geometry_dict() | ({"backlash": None} if thickness else {})
    for gear in ("pinion", "wheel") if quality else ():
        stage[gear] = stage[gear] | {"quality": quality}
    source = nominal_design(model.as_dict(), stage)
    # If a quality is given, the form of the flanks scatters.
    classes = {"thickness": thickness, "centre_distance": distance_class, "form": bool(quality)}
    return source, by_class(source.stage, **classes) | tolerances


def _read_measured(values):
    """Complete the dict of option `values` of the command `fit` in place.

    The path of a YAML file, `path`, is replaced by its measured data set, `data`. The strings in
    `free`, NAME or NAME=LOW,HIGH, are replaced by a dict of the ranges (SI units) in which
    parameters are fitted. Parameters of the gears without an option get the value that the file
    states. The model "pair" of the file is called "rectangle" on the command line.
    """
    path = values.pop("path")
    values["data"] = data = gearlib.read_measured(path)
    section = measured_description.read(path).fit or measured_description.FitSection()
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
        # Without a configuration the fit starts from the middle of the free ranges.
        known = {name: sum(limits) / 2.0 for name, limits in values["free"].items()} | known
    # Options take precedence over the values in the file. Only numbers are parameters of a pair.
    for name in (*GearPairSection.model_fields, *DAMPINGS):
        if values[name] is None and isinstance(known.get(name), int | float):
            values[name] = known[name]
    values["model"] = values["model"] or section.model
    if values["model"] == "pair":
        values["model"] = "rectangle"


@gear_command(
    *("fit", "free", "parameter"), arguments=[_DATA], prepare=_read_measured, rectangle=True
)
def fit(gears, model, data, free):
    """Fit parameters of the gears to the measured set that the YAML file DATA describes."""
    # `gears` are not needed; `free` maps the fitted parameters to (lowest, highest) value. The
    # result prints its parameters with their uncertainties.
    text = f"{data.title}{', synthetic' if data.synthetic else ''}: {data.source}"
    repairs = f"; repairs: {data.attrs['repairs']}" if data.attrs["repairs"] else ""
    click.echo(click.wrap_text(text + repairs, output.WIDTH))
    fitted = gearlib.fit(model, data, free)
    click.echo(str(fitted))
    return fitted.dataset(), lambda plot: plot.fit(fitted)


@main.command(params=options.STAGE + options.command_options("", "format save plot force"))
def gears(format, save, plot, force, **values):
    """Print geometry, mesh stiffness by each method and resonance of two gears given by geometry.

    With a speed and a damping the table includes the motion at that speed, the duty point.
    """
    from gearlib.studies import gear_table

    output.check("--save", save, force, options.YAML)
    output.check("--plot", plot, force, options.PICTURES)
    # A configuration to be saved must have a damping.
    gears = take_gears(values, moves=bool(save), needs_geometry=True)
    if save:
        import yaml

        output.write_text(save, yaml.safe_dump(gears.mapping, sort_keys=False, allow_unicode=True))
    section, damping = gears.settings.gears, gears.settings.dampings[gears.damping].given()
    # The table has all methods; the options belong to the configured method, by default iso.
    options_by_method = {section.stiffness or "iso": section.stiffness_options}
    load = section.load() | {"damping": damping}
    rows = gear_table.gear_quantities(section.mesh(), options=options_by_method, **load)
    if section.speed and gears.damping != NO_DAMPING:
        model = gears.model()
        point = section.speed, section.driving_torque()
        rows += gear_table.duty_rows(model, *point, gears.stiffness(model))
    if format == "text":
        click.echo(gears.name)
    output.gear_table(rows, format)
    if section.speed and gears.damping == NO_DAMPING:
        click.echo("There is no duty point without a damping: give --damping-ratio.", err=True)
    if plot:
        from gearlib.figures import gear_geometry_figure
        from gearlib.studies.gear_geometry import mesh_stiffness

        # These are the keys of a `PublishedPair` without published values.
        pair_dict = section.model_dump() | {"torque": section.driving_torque(), "published": {}}
        curves = mesh_stiffness({"mesh stiffness": pair_dict}, samples=_CURVE_PHASES)
        output.save_picture(
            plot, gears.name, lambda _: gear_geometry_figure.draw_mesh_stiffness(curves)
        )
    # The row "settled" says for each method whether the motion repeats.
    if any(row.name == "settled" and not all(row.values.values()) for row in rows):
        raise click.ClickException("the motion at the duty point has not settled")


@main.command(params=options.PAIR + options.command_options("explore", "port"))
@click.option("--show/--no-show", default=True, help="Open a browser, or do not.")
def explore(port, show, **values):
    """Explore a gear pair with sliders, in the browser."""
    from gearlib.explorer import page

    # `values` are the options that describe the gears; port 0 means any free port.
    gears = take_gears(values)
    page.serve(gears.mapping, gears.damping, port or 0, show)


@main.command()
def schema():
    """Print the JSON schema of the configuration, for editors."""
    click.echo(schema_text(), nl=False)


_FOLDER = click.Path(file_okay=False, path_type=Path)


@main.command()
@click.argument("folder", type=_FOLDER)
@click.option("--gearbox", type=options.FILE, help="REXS file of a gearbox, copied into FOLDER.")
def init(folder, gearbox):
    """Begin a project: write a configuration to start from into FOLDER/config.yaml.

    `gearlib workflow -j2`, called in FOLDER, computes its targets into FOLDER/results. With
    --gearbox these are all stages and load cases of the gearbox, and the whole box.
    """
    from gearlib.config import new_project

    # An existing project is never overwritten; the path `gearbox` is None without the option.
    path = folder / DEFAULT_CONFIG
    if path.exists():
        raise click.UsageError(f"{path} exists: choose another folder")
    text = new_project.TEXT
    if gearbox:
        gearlib.read_gearbox(gearbox)  # Raises the error of a file that cannot be read.
        if (folder / gearbox.name).exists():
            raise click.UsageError(f"{folder / gearbox.name} exists: choose another folder")
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(gearbox, folder / gearbox.name)
        text = new_project.GEARBOX_TEXT.format(file=json.dumps(gearbox.name, ensure_ascii=False))
    output.write_text(path, text)


@main.command(params=[click.Argument(["path"], metavar="FILE", type=options.FILE)])
@click.option("--report", type=options.FILE, help="HTML page of tables and pictures to write.")
@click.option("--force", is_flag=True, help="Replace an existing page.")
def gearbox(path, report, force):
    """Print the stages and loads of a gearbox in a REXS FILE: .rexs, .rexsj, .rexsz, .rexs.zip.

    The page of --report has pictures, each stage over the speed, and the modes of the whole box.
    """
    # Check the page first, because the computations of the report may take minutes.
    output.check("--report", report, force, (".html",))
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
    """Reproduce the paper in FOLDER, by default ./paper: figures, and a table of its statements.

    FOLDER gets results/ and a config.yaml; an existing config.yaml is used as it is.
    """
    # The configuration of the package describes the gears of the paper; "all" and "paper" are rules
    # of its Snakefile.
    path = folder / DEFAULT_CONFIG
    if not path.exists():
        output.write_text(path, (_ROOT / DEFAULT_CONFIG).read_text("utf-8"))
    _run_snakemake(folder, [f"-j{jobs}", "all" if everything else "paper"])


@main.command(params=[click.Argument(["folders"], nargs=-1, required=True, type=_FOLDER)])
@click.option("-o", "--output", "picture", type=options.FILE, help="Picture to draw, as curve.png.")
@click.option("--force", is_flag=True, help="Replace an existing picture.")
def compare(folders, picture, force):
    """Compare projects: print their gears side by side, and draw their resonance in one figure.

    Each FOLDER has results/resonance.nc, which `gearlib workflow -j2 resonance` computes there.
    """
    import pandas

    from gearlib.data import storage

    output.check("--output", picture, force, options.PICTURES)
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise click.UsageError(f"FOLDER {' '.join(names)}: the names of the folders must differ")
    # The table has a column for each project, which maps the names of quantities to values.
    curves, columns = [], {}
    for name, folder in zip(names, folders, strict=True):
        path = folder / "results/resonance.nc"
        allowed = "a folder with results/resonance.nc, computed by `gearlib workflow -j2 resonance`"
        checks.require(path.is_file(), "FOLDER", str(folder), allowed)
        curves.append(storage.read(path))
        scalars = [value for value in curves[-1].data_vars.values() if not value.ndim]
        rows = [(x.name, "", WRITTEN_UNITS.get(x.units, x.units), float(x)) for x in scalars]
        # A project of gears given by geometry has a longer table of their quantities.
        table_path = path.with_name("gears.csv")
        if table_path.is_file():
            cells = pandas.read_csv(table_path, keep_default_na=False)
            rows = cells[["name", "of", "unit", "value"]].values.tolist()
        columns[name] = {" ".join(filter(None, label)): value for *label, value in rows}
    output.frame(pandas.DataFrame(columns))
    if picture:
        from gearlib.figures import resonance_figure, style

        style.save(resonance_figure.draw_cases(curves, names), picture)
        click.echo(f"drawn in {picture}")


@main.command(context_settings={"ignore_unknown_options": True, "help_option_names": ["-h"]})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def workflow(arguments):
    """Run the workflow in this folder: Snakemake with the rules of this package.

    ARGUMENTS are passed to Snakemake, as in `gearlib workflow -j2 --configfile mine.yaml`; as in
    the other commands, --config mine.yaml does the same.
    """
    arguments = list(arguments) or ["-j2"]
    for i, (argument, next_argument) in enumerate(
        zip(arguments, [*arguments[1:], ""], strict=True)
    ):
        # Snakemake's own --config takes pairs KEY=VALUE.
        if argument == "--config" and "=" not in next_argument:
            arguments[i] = "--configfile"
    # "--configfile=mine.yaml" is divided into the option and its value.
    parts = [part for x in arguments for part in re.split("(?<=^--configfile)=", x)]
    is_file = False
    for argument in parts:
        if argument.startswith("-"):
            is_file = argument in ("--configfile", "--configfiles")
        elif is_file:
            # Unlike Snakemake, these checks report a missing file, and the line of an error.
            allowed = "a file; targets stand before this option"
            checks.require(Path(argument).is_file(), "--configfile", argument, allowed)
            validation.read_yaml(argument)
    _run_snakemake(Path(), arguments)


def _run_snakemake(folder, arguments):
    """Run Snakemake in a folder with the rules of this package, and exit with its exit code.

    `arguments` is a list of command-line arguments, such as ["-j2", "all"].
    """
    if find_spec("snakemake") is None:
        raise ModuleNotFoundError("Snakemake is not installed", name="snakemake")
    command = [sys.executable, "-m", "snakemake", "--snakefile", _ROOT / "Snakefile"]
    command += ["--workflow-profile", _ROOT / "profiles/default", "--directory", folder]
    command += ["--report-stylesheet", _ROOT / "workflow/report/report.css", *arguments]
    # Output to a pipe is copied line by line, so that its end does not stop Snakemake.
    # `sys.__stdout__` is None if standard output, descriptor 1, is closed.
    is_pipe = sys.__stdout__ is not None and not os.isatty(1)
    process = subprocess.Popen(command, stdout=subprocess.PIPE if is_pipe else None)
    # Ctrl-C is left to Snakemake, which stops its jobs first.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        for line in process.stdout or ():
            os.write(1, line)
    finally:
        # If the reader of the output ends, as `| head` does, Snakemake goes on undisturbed.
        process.communicate()
    sys.exit(process.returncode)
