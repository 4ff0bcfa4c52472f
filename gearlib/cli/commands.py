"""The commands: options, one library call, output."""

import math

import click

from gearlib.cli import (
    drawing_options,
    drawn_gears,
    fitting,
    model_options,
    output,
    progress,
    refusals,
    scatter_command,
    speed_options,
    workflow_commands,
)
from gearlib.config import gear_names, schema_text
from gearlib.version import __version__

#: What is printed of every mesh of a gear train.
_MESHES = (
    "displacement_max",
    "displacement_min",
    "dynamic_force_max",
    "dynamic_factor",
    "mean_force",
    "load_sharing",
    "fraction_normal",
    "bounces",
)

_state = click.option(
    "--state",
    "initial_state",
    nargs=2,
    metavar="X V",
    type=float,
    default=(0.0, 0.0),
    show_default=True,
    help="Displacement and dx/dtau at the start, static deflections.",
)


@click.group(
    cls=refusals.Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 well; 1 the computation could not do what was asked; 2 wrong input.",
)
@click.version_option(__version__, prog_name="gearlib")
def main():
    """Nonlinear dynamics of gear meshes.

    The gears come from a configuration of the workflow (--config, --damping), from options, or
    from both, the options coming first; values take units, as in --backlash "40 um". The train of
    --model train, modes, static, phasing and campbell is that of the section `train`.
    """


@main.command()
@model_options.options
@speed_options.options
@_state
@click.option("--periods", type=int, default=200, show_default=True, help="Mesh periods.")
@click.option("--record-periods", type=int, default=1, show_default=True, help="Recorded ones.")
@click.option(
    "--samples",
    "samples_per_period",
    type=int,
    default=256,
    show_default=True,
    help="Samples per period.",
)
@click.option("--method", help="A name of gearlib.methods().")
@click.option("--until-settled", is_flag=True, help="Continue until its period is proven.")
@output.options("phase")
def simulate(model, tuning, save, **asked):
    """Run one tuning: time course, contact events, orbit summary."""
    import gearlib
    from gearlib.data import motions

    with progress.clock("simulating"):
        run = gearlib.simulate(model, tuning, **asked)
    if run.status != 0:
        output.fail(run.status.attrs["message"])
    scales = ["period", "static_deflection", "tuning", "speed"]
    if model.mesh_names:
        output.table(run, scales)
        output.columns(run, "mesh", _MESHES)
    else:
        own = ["displacement_max", "displacement_min", "dynamic_force_max", "fraction_normal"]
        output.table(run, [*own, "bounces", *scales])
        if model.speed is not None:
            output.machine(run, model)
    if not run.period:
        click.echo(f"The motion has {motions.not_settled(run)}.")
    save(run, lambda plot: output.beside(plot.time_course(run), model, run, curves=True))


@main.command()
@model_options.options
@click.option(
    "--start",
    type=speed_options.TUNING,
    default=0.5,
    show_default=True,
    help="First tuning, or speed such as 1500rpm; by default at most that of the drawing.",
)
@click.option(
    "--stop",
    type=speed_options.TUNING,
    default=1.4,
    show_default=True,
    help="Last tuning, or speed; by default at least that of the drawing.",
)
@click.option(
    "--speed", type=speed_options.SPEED, help="Of drawn gears, rpm: the default range includes it."
)
@click.option("--points", type=int, default=901, show_default=True, help="Number of tunings.")
@click.option(
    "--direction",
    type=click.Choice(["cold", "up", "down"]),
    default="cold",
    show_default=True,
    help="From rest each, or carrying the state along.",
)
@click.option("--periods", type=int, default=200, show_default=True, help="Mesh periods.")
@click.option("--record-periods", type=int, default=10, show_default=True, help="Recorded ones.")
@click.option("--method", help="A name of gearlib.methods().")
@output.options("tuning")
def sweep(model, start, stop, speed, points, save, **asked):
    """Run many tunings: the resonance characteristic."""
    start = speed_options.tuning_of(model, "start", start)
    stop = speed_options.tuning_of(model, "stop", stop)
    if points < 2 or not 0.0 < start < stop < math.inf:
        raise click.UsageError(
            f"start = {start!r}, stop = {stop!r}, points = {points} is not allowed: it must be 0 < "
            "start < stop, both finite, and at least 2 points"
        )
    import numpy as np
    import xarray as xr

    import gearlib
    from gearlib.runs.run_arguments import check_rows

    start, stop, drawn = speed_options.with_drawn_speed(model, start, stop, speed)
    check_rows(model, f"points = {points}", points)
    grid = np.linspace(start, stop, points)
    if asked["direction"] == "cold":
        # In pieces, so that the bar can move; the tunings do not know of each other.
        pieces = np.array_split(grid, min(points, 20))
        parts = []
        with progress.counter("tunings", points) as done:
            for piece in pieces:
                parts.append(gearlib.sweep(model, piece, **asked))
                done(len(piece))
        curve = xr.concat(parts, "tuning", data_vars="minimal", combine_attrs="identical")
    elif drawn and asked["direction"] == "down":
        curve = _swept_down(model, grid, **asked)
        points = curve.tuning.size
    else:
        with progress.clock(f"{points} tunings {asked['direction']}"):
            curve = gearlib.sweep(model, grid, **asked)
    failed = int((curve.status != 0).sum())
    if failed == points:
        output.fail("no run could go on: see gearlib.data.status for what each code says")
    heights = curve.displacement_max
    if model.mesh_names:
        heights = heights.max("mesh")
    top = curve.isel(tuning=int(heights.argmax("tuning")))
    stopped = f", of which {failed} stopped early" if failed else ""
    click.echo(f"{points} tunings{stopped}; the highest displacement:")
    if model.mesh_names:
        output.table(top, ["tuning", "speed"])
        output.columns(top, "mesh", _MESHES)
    else:
        own = ["displacement_max", "displacement_min", "dynamic_force_max"]
        output.table(top, ["tuning", "speed", *own])
    save(curve, lambda plot: output.beside(plot.resonance(curve), model, curves=True))


def _swept_down(model, grid, direction, **asked):
    """Return a downward sweep that goes on until the motion jumps, and print whether it has."""
    from gearlib.runs import sweeping

    lowest = sweeping.LOWEST_SHARE * grid[0]
    with progress.clock(f"{grid.size} tunings {direction}"):
        curve, jumped = sweeping.sweep_down(model, grid, lowest, **asked)
    at = f"{float(curve.speed[0]):.0f} rpm, tuning {float(curve.tuning[0]):.4g}"
    click.echo(
        f"At {at}, the motion is that of an upward sweep, behind all jumps down."
        if jumped
        else f"The motion has not jumped down at {at}, the lowest of this sweep."
    )
    return curve


@main.command("run-up")
@model_options.options
@click.option("--start", type=speed_options.SPEED, required=True, help="First speed, rpm.")
@click.option("--stop", type=speed_options.SPEED, required=True, help="Last speed, rpm.")
@click.option("--duration", type=float, help="Of the way from one to the other, s. Or instead:")
@click.option("--acceleration", type=float, help="Its size, rpm/s.")
@click.option("--back", is_flag=True, help="Go back to the first speed as well.")
@_state
@click.option("--driver", help="Of a train: the body that drives; by default that of most power.")
@output.options("revolution")
def run_up(model, start, stop, duration, acceleration, back, save, **asked):
    """Run the gears up or down: forces and losses of contact over the speed."""
    import gearlib

    course = {"start": start, "stop": stop, "duration": duration, "acceleration": acceleration}
    if back:
        there = speed_options.course_of(**course)
        course = {"speed": [*there, (2.0 * there[-1][0], start)]}
    with progress.clock("running up"):
        run = gearlib.run_up(model, **course, **asked)
    if run.status != 0:
        output.fail(run.status.attrs["message"])
    force = run.dynamic_force_max.max("mesh") if model.mesh_names else run.dynamic_force_max
    top = run.isel(revolution=int(force.argmax("revolution")))
    click.echo(f"{run.revolution.size} revolutions; that of the largest force:")
    own = ["displacement_max", "displacement_min", "dynamic_force_max", "mean_force", "bounces"]
    output.table(top, ["revolution_speed", "revolution_time", *([] if model.mesh_names else own)])
    if model.mesh_names:
        output.columns(top, "mesh", own)
    save(run, lambda plot: output.beside(plot.run_up(run), model, curves=True))


@main.command()
@model_options.options
@speed_options.options
@click.option("--period", type=int, default=1, show_default=True, help="Mesh periods of it.")
@click.option(
    "--guess",
    nargs=2,
    metavar="X V",
    type=float,
    help="Displacement and dx/dtau near the orbit.",
)
@output.options("coordinate")
def orbit(model, tuning, period, guess, save):
    """Find a periodic orbit and its Floquet multipliers."""
    import gearlib
    from gearlib.analysis.orbits.shooting import NoOrbit

    try:
        with progress.clock("shooting"):
            found = gearlib.periodic_orbit(model, tuning, guess=guess, period=period)
    except NoOrbit as error:
        output.fail(str(error))
    click.echo(f"{'stable' if found.stable else 'unstable'} orbit of period {found.period}")
    output.words(f"state at tau = 0     {_first(f'{x:.15g}' for x in found.state)}")
    output.words(f"Floquet multipliers  {_first(f'{x:.12g}' for x in found.multipliers)}")
    output.words(f"contact pattern      {' '.join(str(code) for code in found.pattern)}")
    if found.grazing:
        output.words("It touches a flank line: the multipliers hold on one side of it only.")
    save(found.dataset(), lambda plot: plot.orbit(found))


def _first(texts, most=12):
    """Return texts in a line, of a train's many the first ones."""
    texts = list(texts)
    more = f" ... {len(texts)} in all" if len(texts) > most else ""
    return " ".join(texts[:most]) + more


@main.command()
@model_options.options
@speed_options.options
@_state
@click.option(
    "--periods", type=click.IntRange(32), default=2000, show_default=True, help="To settle."
)
@output.options("run")
def trust(model, tuning, save, **asked):
    """Chaos or artefact: run one tuning in several ways and label its motion."""
    import gearlib

    with progress.clock("running it in several ways"):
        found = gearlib.trust(model, tuning, **asked)
    output.words(f"{found.label}: {found.message}")
    if not math.isnan(found.exponent):
        rate = f"{found.exponent:.6g} +- {found.uncertainty:.2g}"
        click.echo(f"Lyapunov exponent    {rate} per period")
    save(found.runs, lambda plot: plot.values(found.runs, "displacement_max", "displacement_min"))
    if found.label == "undecided":
        output.fail("undecided: see the message above for what to try")


@main.command()
@model_options.train_options
@output.options("mode")
def modes(train, save):
    """Natural frequencies of the gear train, and the kinds of its modes."""
    found = train.modes()
    output.columns(found, "mode", ["natural_frequency", "mode_kind"])
    save(found, lambda plot: output.beside(plot.values(found, "natural_frequency"), train))


@main.command()
@model_options.train_options
@click.option("--phase", type=float, default=0.0, show_default=True, help="Mesh phase, rad.")
@output.options("mesh")
def static(train, phase, save):
    """Load sharing of the gear train at rest, with gaps and errors."""
    found = train.static(phase)
    if found.status:
        output.fail(found.status.attrs["message"])
    output.columns(found, "mesh", ["mesh_force", "contact", "load_sharing"])
    save(found, lambda plot: output.beside(plot.values(found, "mesh_force"), train, found))


@main.command()
@model_options.train_options
@click.option("--count", type=int, default=6, show_default=True, help="Highest order.")
@output.options("stiffness_order")
def phasing(train, count, save):
    """Which harmonics of the mesh stiffness excite which modes of the gear train."""
    found = train.phasing(count)
    kinds = list(dict.fromkeys(found.mode_kind.values))
    cells = []
    for order in found.stiffness_order.values:
        excites = found.excites.sel(stiffness_order=order).values
        own = (excites[found.mode_kind.values == kind] for kind in kinds)
        cells.append([f"{order:.6g}", *(f"{each.sum()} of {each.size}" for each in own)])
    output.rows(["order", *kinds], cells)
    save(found, lambda plot: output.beside(plot.values(found, "modal_force"), train))


@main.command("gears")
@drawn_gears.options
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "csv"]),
    default="text",
    show_default=True,
    help="For people, programs, spreadsheets.",
)
@click.option("--save", type=output.FILE, help="Configuration to write, .yaml, of these gears.")
@click.option("--plot", type=output.FILE, help=f"Their mesh stiffness, {output.ENDINGS}.")
@click.option("--force", is_flag=True, help="Replace files that are there.")
def gear_table(drawing, damping, mapping, form, save, plot, force):
    """Print geometry, mesh stiffness by each method and resonance of two drawn gears."""
    output.check("--save", save, force, (".yaml", ".yml"))
    output.check("--plot", plot, force, output.PICTURES)
    if save is not None:
        drawing_options.check_damped(mapping)
        import yaml

        output.write(save, yaml.safe_dump(mapping, sort_keys=False, allow_unicode=True))
    from gearlib.studies import gear_table

    options = {drawing.stiffness or "iso": drawing.stiffness_options}
    mesh, load = drawing.mesh(), drawing.load()
    rows = gear_table.compute(mesh, damping=damping, options=options, **load)
    if drawing.speed is not None and drawing_options.damped(mapping):
        own = {"stiffness": drawing.stiffness, "options": drawing.stiffness_options}
        with progress.clock("following the motion until it settles"):
            rows += gear_table.duty_rows(mesh, damping=damping, **load, **own)
    output.name_gears(gear_names.of_drawing(drawing), shown=form == "text")
    drawn_gears.show(rows, form)
    if drawing.speed is not None and not drawing_options.damped(mapping):
        click.echo("No duty point without a damping: give --damping-ratio.", err=True)
    if plot is not None:
        output.picture(plot, drawn_gears.stiffness_figure(drawing))
    if any(row.name == "settled" and not all(row.values.values()) for row in rows):
        output.fail("the motion of the duty point has not settled: its numbers do not hold")


@main.command()
@model_options.train_options
@click.option("--count", type=int, default=1, show_default=True, help="Highest order of a mesh.")
@output.options("mode")
def campbell(train, count, save):
    """Speeds at which the mesh frequencies of the gear train excite a natural mode."""
    found = train.campbell(count)
    excited = []
    for order in found.stiffness_order.values:
        own = found.sel(stiffness_order=order)
        for mode in own.mode.values[own.excites.values]:
            one = own.sel(mode=mode)
            numbers = one.critical_speed.item(), order, one.natural_frequency.item()
            excited.append((*numbers, one.mode_kind.item()))
    cells = [[*(f"{number:.6g}" for number in row[:3]), row[3]] for row in sorted(excited)]
    output.rows(["critical_speed rpm", "order", "natural_frequency Hz", "mode_kind"], cells)
    save(found, lambda plot: output.beside(plot.campbell(found), train))


@main.command()
def schema():
    """Print the JSON schema of the configuration, which editors read."""
    click.echo(schema_text(), nl=False)


@main.command()
@click.argument("path", metavar="[FILE]", type=output.FILE, default="gears.yaml")
@click.option("--force", is_flag=True, help="Replace the file if there is one.")
def init(path, force):
    """Write a configuration to begin with into FILE, by default gears.yaml: every key explained."""
    from gearlib.config import new_project

    output.check("FILE", path, force, (".yaml", ".yml"))
    output.write(path, new_project.text(path.name))


@main.command()
@model_options.configuration_options
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    callback=refusals.free_port,
    help="Port on this machine; any free one by default.",
)
@click.option("--show/--no-show", default=True, help="Whether to open a browser.")
@click.option("--model", hidden=True, expose_value=False, callback=refusals.other_model)
def explore(mapping, damping, port, show):
    """Explore the gear mesh with sliders, in the browser."""
    try:
        from gearlib.explorer import page
    except ModuleNotFoundError as error:
        output.fail(f"{error.name} is missing: install gearlib[explore]")
    page.serve(mapping, damping, port, show)


for one in (
    fitting.fit,
    scatter_command.scatter,
    workflow_commands.paper,
    workflow_commands.workflow,
):
    main.add_command(one)
