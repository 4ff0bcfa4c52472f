"""Studies behind the paper's figures and statements."""

import re

from gearlib import tunings
from gearlib.config import gear_names
from gearlib.config.experiments import PhaseLag, PhasePlanes, Resonance, RunUps
from gearlib.config.studies import of_rigs
from gearlib.config.studies.study import (
    CLAIMS,
    EXPLANATIONS,
    PAPER,
    STARTS,
    Drawing,
    Job,
    Study,
    Table,
    about_forces,
    bearings_of_scenes,
    grid_of,
    listed,
    model_of,
    of_dampings,
    run_length,
    sampled_run,
)

#: The numbers of the reasons that the documentation gives for the verdicts.
WHY = ["parametric_resonance.csv", "certificates.csv"]


def _known_motions(c):
    """Return the files with special points and labels that the same reasons rest on."""
    return [
        file
        for pattern in ("branches/{damping}.nc", "labels/{damping}.nc")
        for file in of_dampings(pattern)(c)
    ]


def _colours(c):
    return {"colours": c.figures.colours}


def _of_resonance(c):
    # The paper's picture has no forces.
    return _colours(c) | ({} if gear_names.is_paper(c) else {"forces": True})


def _windows(c):
    """Return the files of all windows of the resonance characteristic."""
    return [
        f"resonance/{damping}/{direction}/{tunings.name_of(*window)}.nc"
        for damping in c.dampings
        for direction in c.resonance.directions
        for window in c.resonance.windows(direction)
    ]


def _planes(c):
    """Return the files of all phase planes."""
    names = [tunings.name_of(tuning) for tuning in c.phase_planes.tunings]
    return [f"phase_planes/{damping}/{name}.nc" for damping in c.dampings for name in names]


def _beside(target, files):
    """Return the function that gives files which Fig. 3 shows if they are those of a target."""
    return lambda c: (files(c) if callable(files) else files) if target in c.wanted() else None


def _resonance_caption(c):
    targets, run = c.targets, c.run
    parts = [
        f"""Largest and smallest relative displacement over the tuning ν for {listed(c.dampings)},
        record of the last {run.recorded_revolutions} of {run.revolutions} revolutions. The tuning
        ν_s is the mesh frequency over the natural frequency at the mean mesh stiffness, ν_max and
        ν_min are those at its largest and its smallest value. Shaded, where in view: backlash,
        inverse mesh. Lines are motions that have settled on a periodic orbit, by proof; dots are
        all others. *cold*, from rest: every tuning starts from the initial state; *up*, *down*: the
        state is carried from tuning to tuning, which shows hysteresis."""
    ]
    if c.gears and c.resonance.lowest:
        parts.append(
            f"""The downward sweep goes on below until its motion is that of an upward sweep; one
            that ends at {c.resonance.lowest:g} has not jumped."""
        )
    if not gear_names.is_paper(c):
        parts.append("Below: the largest mesh force, over the load and in kN.")
    parts.append(about_forces(c))
    if "branches" in targets:
        parts.append(
            """Thin lines below: orbits of one mesh period, and of two where they branch off, solid
            where stable, dashed where unstable."""
        )
    if "labels" in targets:
        parts.append(
            """The strip at the edge classifies the motion from rest, by runs of several kinds and
            its largest Lyapunov exponent."""
        )
    if "parametric_resonance" in targets:
        parts.append(
            """Bands: instability tongues, tunings at which the motion without contact loss is
            unstable at that damping."""
        )
    if c.measured:
        parts.append(
            """Points and dotted lines: measured, points going up and down and jumps, see the table
            of measured sets; hollow where gain or zero of the sensor are unknown, and fitted."""
        )
    return " ".join(parts)


def _label_of_scene(c, wildcards):
    """Return the label of a scene in the report: its name in words, its dampings."""
    words = re.sub(r"^fig(\d+)_", r"Fig. \1: ", wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case.damping for case in c.scenes[wildcards.scene].cases)
    return f"{words}, damping {', '.join(dampings)}"


def cases_of(c):
    """Return the function of wildcards: the cases of a scene, with their gear pairs."""
    return lambda wildcards: [
        {"title": case.title, "tuning": case.tuning, "pair": c.case_parameters(case)}
        for case in c.scenes[wildcards.scene].cases
    ]


def _without_scenes(c):
    """Return what is wrong where scenes of other gears than the paper's are asked for: none are."""
    needed = "scenes = {} is not allowed: the paper's suit its pair only, it must have at least one"
    return needed if c.gears and not c.scenes else bearings_of_scenes(c)


PHASE_LAG = Study(
    "phase_lag",
    PhaseLag,
    PAPER,
    Job(
        "phase_lag",
        "phase_lag:compute",
        lambda c: {
            **c.phase_lag.model_dump(include={"tuning", "harmonics", "periods"}),
            "pair": c.gear_pair.model_dump(),
            "dampings": c.phase_lag.material_dampings,
            "tunings": grid_of(c.phase_lag),
            "samples_per_period": c.run.samples_per_period,
        },
    ),
    Drawing(
        "phase_shift_figure.draw",
        {"lags": "phase_lag.nc"},
        "fig2_phase_shift",
        "Fig. 2: phase lag, material damping",
        lambda c: (
            f"""Relative motion over the mesh stiffness for the material dampings
        {listed(c.phase_lag.material_dampings)} N s/m, the lag of each harmonic of the mesh
        period behind that of the stiffness, and the lag of the first one over the tuning;
        gaps: no orbit of one mesh period, or chaos before the motion settles."""
        ),
    ),
)

RESONANCE = Study(
    "resonance",
    Resonance,
    PAPER,
    Job(
        "sweep_window",
        "resonance_windows:compute",
        lambda c: {
            "pair": model_of(c),
            "window": lambda wildcards: tunings.values_of(wildcards.window),
            "step": c.resonance.step,
            "lowest": c.resonance.lowest,
            "run": run_length(c),
            "damping": "{damping}",
            "direction": "{direction}",
        },
        files=("resonance/{damping}/{direction}/{window}.nc",),
    ),
    Job(
        "gather_resonance",
        "gearlib.data.gathering:gather_resonance",
        data={"shards": _windows},
        files=("resonance.nc",),
        kernels=(),
    ),
    Drawing(
        "resonance_figure.draw",
        {
            "resonance": "resonance.nc",
            "labels": _beside("labels", of_dampings("labels/{damping}.nc")),
            "branches": _beside("branches", of_dampings("branches/{damping}.nc")),
            "tongues": _beside("parametric_resonance", "tongues.nc"),
            "measured": of_rigs.curves,
        },
        "fig3_resonance",
        "Fig. 3: resonance characteristics, all dampings",
        _resonance_caption,
        _of_resonance,
    ),
)

RUN_UPS = Study(
    "run_ups",
    RunUps,
    EXPLANATIONS,
    Job(
        "run_ups",
        "run_ups:compute",
        lambda c: {
            **c.run_ups.model_dump(include={"start", "stop", "damping", "revolutions"}),
            "pair": c.pair_parameters(c.run_ups.damping),
            "mesh_orders": c.run_ups.orders,
        },
    ),
    Drawing(
        "run_ups_figure.draw",
        {
            "run_ups": "run_ups.nc",
            "resonance": _beside("resonance", "resonance.nc"),
            "branches": _beside("branches", lambda c: f"branches/{c.run_ups.damping}.nc"),
        },
        "run_ups",
        "Beside Fig. 3: run-ups, and their orders",
        lambda c: (
            f"""Above: largest and smallest displacement in each revolution over the tuning with the
        damping {c.run_ups.damping}, where the speed rises evenly in so many revolutions and falls
        again in as many. Grey, where sweeps were asked for: they settle at every speed, and jump at
        the folds; a run-up jumps behind them, the further the faster. Below: the order map of the
        mesh force of the slowest one, Fourier integrals over whole revolutions; z: teeth. Smallest
        model: one degree of freedom with two levels of stiffness, whose run-ups are closed
        forms. {about_forces(c)}"""
        ),
    ),
)

PHASE_PLANES = Study(
    "phase_planes",
    PhasePlanes,
    PAPER,
    Job(
        "phase_plane",
        "recorded_planes:compute",
        lambda c: {
            "pair": model_of(c),
            "tuning": lambda wildcards: tunings.values_of(wildcards.tuning)[0],
            "run": sampled_run(c),
            "damping": "{damping}",
        },
        files=("phase_planes/{damping}/{tuning}.nc",),
    ),
    Job(
        "gather_phase_planes",
        "gearlib.data.gathering:gather_phase_planes",
        data={"shards": _planes},
        files=("phase_planes.nc",),
        kernels=(),
    ),
    Drawing(
        "phase_planes_figure.draw",
        {"phase_planes": "phase_planes.nc"},
        "fig5_phase_planes",
        "Fig. 5: phase planes, all dampings",
        lambda c: (
            f"""Phase planes of the last {c.run.recorded_revolutions} of
        {c.run.revolutions} revolutions: one row for each tuning
        ({listed(c.phase_planes.tunings)}), one column for each damping
        ({listed(c.dampings)}). The backlash is shaded. A cell says whether all mesh periods of
        the record draw a single line (*steady*) or not (*unsteady*), and on an orbit of how many
        mesh periods the motion settles later on: by proof, from its Floquet multipliers.
        *Not settled*: the run was followed on for so many mesh periods without such a proof."""
        ),
        _colours,
    ),
)

SCENES = Study(
    "scenes",
    None,
    PAPER,
    Job(
        "scene",
        "scenes:of_comparison",
        lambda c: {
            "cases": cases_of(c),
            "six_degrees": c.six_degree_parameters(),
            "run": sampled_run(c),
            "starts": c.models.model_dump(include=STARTS),
        },
        {"comparison": "models/{scene}.nc"},
        files=("scenes/{scene}.nc",),
    ),
    Drawing(
        "time_courses_figure.draw",
        {"scene": "scenes/{scene}.nc"},
        "{scene}",
        _label_of_scene,
        """Phase planes and time courses of the scene {{scene}}, the last mesh periods of the
        record; light grey: contact loss, dark grey: inverse mesh, bar: contact at the lower
        stiffness.""",
        lambda c: (
            lambda wildcards: {
                "courses": c.scenes[wildcards.scene].courses,
                "periods_shown": c.scenes[wildcards.scene].periods_shown,
            }
        ),
        name="scene",
        names=lambda c: {"scene": list(c.scenes)},
    ),
    refusal=_without_scenes,
)

STATEMENTS = Study(
    "claims",
    None,
    CLAIMS,
    Table(
        "claims",
        "",
        {},
        "Statements, computed numbers, verdicts",
        """Statements of the paper, what was computed for each, and the verdict that follows
        from the numbers. A statement that differs stays in the table.""",
    ),
    results=lambda c: ["claims.md", *WHY, *_known_motions(c)],
    refusal=lambda c: (
        "gears is not allowed: its statements are about the paper's pair, it must be left out"
        if c.gears
        else ""
    ),
)
