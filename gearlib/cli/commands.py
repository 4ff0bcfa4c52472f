"""The commands: one call of the library, what is printed and drawn."""

import json
import math
import signal
import subprocess
import sys
from pathlib import Path

import click

import gearlib
from gearlib.cli import options, output
from gearlib.cli.gears import DEFAULT_CONFIG, NO_DAMPING, described, in_rpm
from gearlib.config import measured_description, schema_text, tolerances_section, yaml_keys
from gearlib.config.gear_pair_section import DAMPINGS, GearPairSection
from gearlib.models import tolerated
from gearlib.parameters import WRITTEN_UNITS

#: Folder of the Snakefile, in a wheel or in a checkout.
_INSTALLED = Path(__file__).parents[1] / "installed_workflow"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[2]
#: Names of many options, and the argument of `fit`.
_RUN = "tuning speed initial_state periods record_periods samples method until_settled"
_SCATTER = "tolerance thickness_class distance_class quality quantity samples speed start stop "
_DATA = click.Argument(["path"], metavar="DATA", type=options.FILE)


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
    gear train of --model train, modes, static, phasing and campbell.
    """


def command(name, names, over, use="speeds", arguments=(), prepare=None):
    """Return a decorator that makes a command of a function; `names` are those of its options.

    The function takes gears, their model and options; it returns a dataset, with tables over a
    dimension, and what draws it. `use` is "one speed", "speeds" or, of trains, "rest".
    """

    def call(function, values):
        from gearlib.runs.run_arguments import tuning_of

        path, picture, force = (values.pop(key) for key in ("output", "plot", "force"))
        output.check("--output", path, force, options.DATA)
        output.check("--plot", picture, force, options.PICTURES)
        if prepare:
            prepare(values)
        if use == "rest":
            values["model"] = "train"
        gears = described(values, moves=use != "rest")
        model = gears.model(tooth_pairs=use == "one speed")
        if use == "one speed":
            speed = values.pop("speed")
            if speed is None and values["tuning"] is None and gears.settings.gears:
                speed = gears.settings.gears.speed
            values["tuning"] = tuning_of(model, values["tuning"], in_rpm("speed", speed))
        click.echo(gears.name)
        if use != "rest" and gears.settings.gears and model.force_note:
            click.echo(click.wrap_text(model.force_note, output.WIDTH))
        dataset, draw = function(gears, model, **values)
        if path:
            output.write(path, dataset, over)
        if picture:
            output.picture(picture, gears.name, draw, model, dataset)

    of_gears = options.PAIR if use == "rest" else options.MODEL
    parameters = [*arguments, *of_gears, *options.named(name, f"{names} output plot force")]
    return lambda function: main.command(name, params=parameters, help=function.__doc__)(
        lambda **values: call(function, values)
    )


def _tunings(model, start, stop):
    """Return the first and the last tuning of a range, whose ends may be speeds."""
    from gearlib.runs.run_arguments import check_speed

    ends = {"start": 0.5 if start is None else start, "stop": 1.4 if stop is None else stop}
    for name, end in ends.items():
        ends[name] = check_speed(model, name, in_rpm(name, end)) if isinstance(end, str) else end
    return ends.values()


def _at_largest(dataset, name, over):
    """Return a dataset where a variable, of all meshes, is largest over a dimension."""
    values = dataset[name].max("mesh") if "mesh" in dataset[name].dims else dataset[name]
    return dataset.isel({over: int(values.fillna(-math.inf).argmax(over))})


@command("simulate", _RUN, over="phase", use="one speed")
def simulate(gears, model, tuning, samples, **settings):
    """Run the gears at one speed: time course, contact events, orbit."""
    from gearlib.analysis.duty_point import si_variables
    from gearlib.data.result import result

    run = gearlib.simulate(model, tuning, samples_per_period=samples, **settings)
    output.show(run)
    if not model.mesh_names:
        duty = result("Duty point of a gear mesh", model, si_variables(run, model), method="run")
        output.show(duty.drop_vars(["tuning", "speed"]))
    return run, lambda plot: plot.time_course(run)


@command("sweep", "start stop speed points direction periods record_periods method", over="tuning")
def sweep(gears, model, start, stop, speed, points, direction, **settings):
    """Run many tunings: the resonance characteristic.

    The default range of drawn gears includes their --speed. With --direction down it extends
    downwards until the motion has jumped down.
    """
    import numpy as np

    from gearlib.runs import run_arguments, sweeping

    first, last = _tunings(model, start, stop)
    is_wide = gears.drawn is not None and start is None and stop is None
    speed = in_rpm("speed", speed) or (is_wide and gears.drawn.speed)
    if is_wide and speed:
        tuning = run_arguments.check_speed(model, "speed", speed)
        first, last = min(first, tuning), max(last, tuning)
    grid = np.linspace(first, last, points)
    if is_wide and direction == "down":
        lowest = sweeping.EXTENSION_RATIO * first
        curve, jumped = sweeping.sweep_down(model, grid, lowest, **settings)
        has = "has jumped down above" if jumped else "has not jumped down at"
        click.echo(f"The motion {has} {float(curve.speed[0]):.0f} rpm, the lowest speed.")
    else:
        curve = gearlib.sweep(model, grid, direction=direction, **settings)
    failed = int((curve.status != 0).sum())
    click.echo(f"{curve.tuning.size} tunings, {failed} failed; at the largest displacement:")
    output.show(_at_largest(curve, "displacement_max", "tuning"))
    return curve, lambda plot: plot.resonance(curve)


@command("run-up", "start stop duration acceleration back initial_state driver", over="revolution")
def run_up(gears, model, start, stop, duration, acceleration, back, **settings):
    """Run the gears up or down: forces and contact losses over the speed."""
    from gearlib.runs.run_up import speed_profile

    start, stop = in_rpm("start", start), in_rpm("stop", stop)
    course = speed_profile(start, stop, duration, acceleration).tolist()
    course += [[2.0 * course[-1][0], start]] if back else []
    run = gearlib.run_up(model, speed=course, **settings)
    click.echo(f"{run.revolution.size} revolutions; that of the largest force:")
    output.show(_at_largest(run, "dynamic_force_max", "revolution"))
    return run, lambda plot: plot.run_up(run)


@command("orbit", "tuning speed period guess", over="coordinate", use="one speed")
def orbit(gears, model, tuning, **settings):
    """Find a periodic orbit and its Floquet multipliers."""
    from gearlib.analysis.orbits.shooting import NoOrbit

    try:
        orbit = gearlib.periodic_orbit(model, tuning, **settings)
    except NoOrbit as error:
        raise click.ClickException(str(error)) from None
    click.echo(f"{'stable' if orbit.stable else 'unstable'} orbit of period {orbit.period}")
    output.show(orbit.dataset())
    return orbit.dataset(), lambda plot: plot.orbit(orbit)


@command("trust", "tuning speed initial_state periods", over="run", use="one speed")
def trust(gears, model, tuning, **settings):
    """Chaos or artefact: run one tuning in several ways and label the motion."""
    verdict = gearlib.trust(model, tuning, **settings)
    click.echo(click.wrap_text(f"{verdict.label}: {verdict.message}", output.WIDTH))
    click.echo(f"Lyapunov exponent: {verdict.exponent:.6g} +- {verdict.uncertainty:.2g} per period")
    if verdict.label == "undecided":
        raise click.ClickException("undecided: the message above says what to try")
    extrema = ("displacement_max", "displacement_min")
    return verdict.runs, lambda plot: plot.values(verdict.runs, *extrema)


@command("modes", "", over="mode", use="rest")
def modes(gears, train):
    """Natural frequencies of the gear train, and the kinds of its modes."""
    modes = train.modes()
    output.show(modes)
    return modes, lambda plot: plot.values(modes, "natural_frequency")


@command("static", "phase", over="mesh", use="rest")
def static(gears, train, phase):
    """Load sharing of the gear train at rest, with gaps and errors."""
    equilibrium = train.static(phase)
    output.show(equilibrium)
    return equilibrium, lambda plot: plot.values(equilibrium, "mesh_force")


@command("phasing", "count", over="stiffness_order", use="rest")
def phasing(gears, train, count):
    """Which harmonics of the mesh stiffness excite which modes of the gear train."""
    phasing = train.phasing(count)
    modes = phasing[["excites", "mode_kind"]].to_dataframe()
    excites = modes.groupby(["stiffness_order", "mode_kind"], sort=False).excites
    output.frame(excites.agg(lambda modes: f"{modes.sum()} of {modes.size}").unstack())
    return phasing, lambda plot: plot.values(phasing, "modal_force")


@command("campbell", "count", over="mode", use="rest")
def campbell(gears, train, count):
    """Speeds, rpm, at which the mesh frequencies of the gear train excite a natural mode."""
    diagram = train.campbell(count)
    table = diagram[["critical_speed", "natural_frequency", "mode_kind", "excites"]]
    table = table.to_dataframe().reset_index("stiffness_order")
    table = table[table.pop("excites").astype(bool)].set_index("critical_speed").sort_index()
    output.frame(table)
    return diagram, lambda plot: plot.campbell(diagram)


def _tolerance(text):
    """Return a tolerance such as "load std=5%" as the configuration has it."""
    name, *words = text.split() or [""]
    law = dict(word.split("=") for word in words if word.count("=") == 1)
    if not law or len(law) < len(words) or not all(law.values()):
        raise click.UsageError(f"--tolerance {text!r} must have keys, each once, as 'load std=5%'")
    law = {key: options.value(text) for key, text in law.items()}
    # Other keys are parameters of a distribution.
    section = tolerances_section.ToleratedParameter
    shape = {key: law.pop(key) for key in law.keys() - section.model_fields.keys()}
    return section.model_construct(parameter=name, shape=shape or None, **law)


@command("scatter", _SCATTER + "points seed", over="sample")
def scatter(gears, model, quantity, samples, points, **settings):
    """Scatter of jumps, contact loss, peaks and the duty point at a speed by tolerances."""
    import numpy as np
    import pandas

    from gearlib.figures import scatter_figure
    from gearlib.studies import tolerance_study
    from gearlib.uncertainty.scatter import refused

    first, last = _tunings(model, settings.pop("start"), settings.pop("stop"))
    settings["tunings"] = np.linspace(first, last, points) if points else None
    settings["speed"] = in_rpm("speed", settings["speed"])
    classes = ("tolerance", "thickness_class", "distance_class", "quality")
    source, laws = _scattering(gears, model, *map(settings.pop, classes))
    if model.size == 2:
        quantity = quantity or tolerances_section.Tolerances.model_fields["quantities"].default
        settings["directions"] = ("up", "down", "seeded")
    with click.progressbar(length=samples, file=sys.stderr, hidden=not sys.stderr.isatty()) as bar:
        designs = gearlib.scatter(source, laws, quantity, samples, progress=bar.update, **settings)
    for text in refused(designs):
        click.echo(click.wrap_text(text, output.WIDTH))
    heads, *rows = tolerance_study.rows(designs)
    table = pandas.DataFrame(rows, columns=heads).replace({"unit": WRITTEN_UNITS})
    if rows:
        output.frame(table.set_index("quantity"))
    if points:
        click.echo("Largest share of the designs that lose contact at a speed:")
        output.frame(designs.contact_loss_probability.max("speed").to_dataframe())
    draw = scatter_figure.bands if points else scatter_figure.quantities
    return designs, lambda plot: draw(designs).axes[0]


def _scattering(gears, model, tolerance, thickness_class, distance_class, quality):
    """Return what scatters, a model or its drawing, and tolerances with those of the classes."""
    thickness = thickness_class and (thickness_class.split() * 2)[:2]
    section, parameters = gears.settings.tolerances, list(map(_tolerance, tolerance))
    is_section = not parameters and "tolerances" in gears.mapping
    has_classes = bool(thickness or distance_class or quality)
    if not (parameters or is_section or has_classes):
        raise click.UsageError("--tolerance is missing: give one, such as -t 'load std=5%'")
    laws, known = {}, tolerances_section.known_parameters()
    for one in section.parameters if is_section else parameters:
        kind = known[one.parameter].kind if one.parameter in known else None
        laws[one.parameter] = one.law(f"tolerances.{one.parameter}", kind)
    drawing_only = tolerated.drawing_parameters().keys() - tolerated.pair_parameters().keys()
    of_drawing = laws.keys() & drawing_only
    if is_section and section.correlations:
        laws["correlations"] = [[*pair.parameters, pair.rho] for pair in section.correlations]
    if not has_classes and not of_drawing:
        return model, laws
    if gears.drawn is None:
        raise click.UsageError("tolerances of a drawing need drawn gears and --model one_degree")
    from gearlib.studies.tolerance_study import nominal_design
    from gearlib.uncertainty.quality_classes import by_class

    drawing = gears.drawn.described() | ({"backlash": None} if thickness else {})
    for part in ("pinion", "wheel") if quality else ():
        drawing[part] = drawing[part] | {"quality": quality}
    source = nominal_design(model.as_dict(), drawing)
    classes = {"thickness": thickness, "centre_distance": distance_class, "form": bool(quality)}
    return source, by_class(source.mesh, **classes) | laws


def _read_measured(values):
    """Read the measured set of `fit`; options precede what is known, and middles of free ranges."""
    path = values.pop("path")
    values["data"] = data = gearlib.read_measured(path)
    section = measured_description.read(path).fit or measured_description.FitSection()
    ranges = {} if values["free"] else dict(section.free)
    for text in values["free"]:
        name, equals, ends = text.partition("=")
        ranges[name] = ends.split(",") if equals else section.free.get(name, [])
    if not ranges:
        raise click.UsageError(f"--free is missing: give NAME=LOW,HIGH, or fit.free in {path}")
    values["free"] = {name: measured_description.range_of(name, x) for name, x in ranges.items()}
    known = json.loads(data.attrs["known"])
    if values["config"] is None and not DEFAULT_CONFIG.exists():
        known = {name: sum(ends) / 2.0 for name, ends in values["free"].items()} | known
    for name in (*GearPairSection.model_fields, *DAMPINGS):
        if values[name] is None and isinstance(known.get(name), int | float):
            values[name] = known[name]
    values["model"] = values["model"] or section.model


@command("fit", "free", over="parameter", arguments=[_DATA], prepare=_read_measured)
def fit(gears, model, data, free):
    """Fit parameters of the gears to the measured set that the YAML file DATA describes."""
    texts = f"{data.title}{', synthetic' * data.synthetic}: {data.source}", data.attrs["repairs"]
    click.echo(click.wrap_text("; repairs: ".join(filter(None, texts)), output.WIDTH))
    fitted = gearlib.fit(model, data, free)
    click.echo(str(fitted))
    return fitted.dataset(), lambda plot: plot.fit(fitted)


@main.command(params=options.DRAWN_GEARS + options.named("gears", "format save plot force"))
def gears(format, save, plot, force, **values):
    """Print geometry, mesh stiffness by each method and resonance of two drawn gears.

    With a speed and a damping the table includes the duty point.
    """
    from gearlib.studies import gear_table

    output.check("--save", save, force, options.YAML)
    output.check("--plot", plot, force, options.PICTURES)
    gears = described(values, moves=bool(save), draws=True)
    if save:
        import yaml

        output.write_text(save, yaml.safe_dump(gears.mapping, sort_keys=False, allow_unicode=True))
    drawing, pair = gears.settings.gears, gears.settings.pair_parameters(gears.damping)
    load = drawing.load() | {"damping": {name: pair[name] for name in options.DAMPINGS}}
    mesh, method, settings = drawing.mesh(), drawing.stiffness or "iso", drawing.stiffness_options
    rows = gear_table.compute(mesh, options={method: settings}, **load)
    if drawing.speed and gears.damping != NO_DAMPING:
        method = drawing.stiffness
        rows += gear_table.duty_rows(mesh, stiffness=method, options=settings, **load)
    if format == "text":
        click.echo(gears.name)
    output.gear_table(rows, format)
    if drawing.speed and gears.damping == NO_DAMPING:
        click.echo("There is no duty point without a damping: give --damping-ratio.", err=True)
    if plot:
        from gearlib.figures import mesh_stiffness_figure
        from gearlib.studies.drawn_gears import mesh_stiffness

        section = drawing.model_dump() | {"torque": drawing.driving_torque(), "published": {}}
        curves = mesh_stiffness({"mesh stiffness": section}, samples=257)
        output.picture(plot, gears.name, lambda _: mesh_stiffness_figure.draw(curves))
    if any(row.name == "settled" and not all(row.values.values()) for row in rows):
        raise click.ClickException("the motion at the duty point has not settled")


@main.command(params=options.PAIR + options.named("explore", "port"))
@click.option("--show/--no-show", default=True, help="Open a browser, or do not.")
def explore(port, show, **values):
    """Explore a gear pair with sliders, in the browser."""
    from gearlib.explorer import page

    gears = described(values)
    page.serve(gears.mapping, gears.damping, port or 0, show)


@main.command()
def schema():
    """Print the JSON schema of the configuration, for editors."""
    click.echo(schema_text(), nl=False)


@main.command()
@click.argument("path", metavar="[FILE]", type=options.FILE, default="gears.yaml")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def init(path, force):
    """Write a configuration to start from into FILE, by default gears.yaml, with every key."""
    from gearlib.config import new_project

    output.check("FILE", path, force, options.YAML)
    output.write_text(path, new_project.text(path.name))


@main.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path), default="paper")
@click.option("-j", "--jobs", default=2, show_default=True, help="Parallel processes.")
@click.option("--all", "everything", is_flag=True, help="Compute all targets.")
def paper(folder, jobs, everything):
    """Reproduce the paper in FOLDER, by default ./paper: figures, and a table of its statements.

    FOLDER gets results/ and a config.yaml; an existing config.yaml is used as it is.
    """
    if not (folder / "config.yaml").exists():
        output.write_text(folder / "config.yaml", (_ROOT / "config.yaml").read_text("utf-8"))
    _snakemake(folder, [f"-j{jobs}", "all" if everything else "paper"])


@main.command(context_settings={"ignore_unknown_options": True, "help_option_names": ["-h"]})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def workflow(arguments):
    """Run the workflow in this folder: Snakemake with the rules of this package.

    ARGUMENTS are those of Snakemake, as in `gearlib workflow -j2 --configfile mine.yaml`; as in the
    other commands, --config mine.yaml does the same.
    """
    words = list(arguments) or ["-j2"]
    for i, (word, following) in enumerate(zip(words, [*words[1:], ""], strict=True)):
        # Snakemake's own --config takes pairs KEY=VALUE.
        if word == "--config" and "=" not in following:
            words[i] = "--configfile"
        if word.endswith((".yaml", ".yml")) and Path(word).is_file():
            yaml_keys.read(word)  # It names the line of what is not YAML, Snakemake does not.
    _snakemake(Path(), words)


def _snakemake(folder, arguments):
    """Call Snakemake in a folder, and end as it ends."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", _ROOT / "Snakefile"]
    command += ["--workflow-profile", _ROOT / "profiles/default", "--directory", folder]
    # The profile names the stylesheet from the folder of the rules.
    command += ["--report-stylesheet", _ROOT / "workflow/report/report.css", *arguments]
    process = subprocess.Popen(command)
    # Ctrl-C is for Snakemake, which ends its jobs first.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(process.wait())
