"""Studies that explain the figures: models, jump, branches, proofs, tongues."""

from gearlib.config.experiments import (
    Branches,
    Certificates,
    Jump,
    Labels,
    NonlinearDamping,
    ParametricResonance,
)
from gearlib.config.scenes_section import Models
from gearlib.config.studies.paper_figures import cases_of
from gearlib.config.studies.study import (
    EXPLANATIONS,
    GRID,
    STARTS,
    Drawing,
    Job,
    Study,
    Table,
    bearings_of_scenes,
    each,
    grid_of,
    model_of,
    of_dampings,
    pairs_of,
    run_length,
    without,
)


def marked(c):
    """Return the settings of figures that mark tunings."""
    return {"marked": c.jump.marked}


def _of_scenes(c):
    return each("models/{scene}.nc", c.scenes)


def _scenes(c):
    return {"scenes": list(c.scenes)}


def _question_of(c):
    """Return the function of wildcards: what the comparison of models asks of a scene."""

    def question(wildcards):
        scene = c.scenes[wildcards.scene]
        return {
            "observables": scene.observables,
            "tolerance": scene.tolerance,
            "candidates": c.candidates(scene),
        }

    return question


def _places_and_powers(c):
    """Return the files of all models of the study of nonlinear damping."""
    powers = ("linear", "quadratic", "cubic")
    return [f"nonlinear_damping/{place}_{p}.nc" for place in ("material", "oil") for p in powers]


def _jump_caption(c):
    marks = c.jump.marked
    orange = f"Orange: tunings {' and '.join(map(str, marks))}, for comparison." if marks else ""
    return f"""Height of the orbit reached from rest over the tuning, and the tuning of the jump
        over what may move it: number of stiffness harmonics, tolerance of an integrator without
        event location, damping, backlash, initial state. Dotted: the jump without any of these
        changes. Of each tolerance: median and range (pale) of the distances from the exact jump,
        from {c.jump.starts} starts. {orange} Crosses: the scan has more than one jump."""


JUMP = Study(
    "jump",
    Jump,
    EXPLANATIONS,
    Job(
        "jump",
        "jump:compute",
        lambda c: {
            "pair": c.pair_parameters(c.jump.damping),
            "settings": without(c.jump, "marked"),
            "run": run_length(c),
            "tunings": grid_of(c.jump),
        },
    ),
    Drawing(
        "jump_figure.draw",
        {"jumps": "jump.nc"},
        "fig6_jump",
        "Beside Fig. 6: what moves the jump from rest",
        _jump_caption,
        marked,
    ),
)

LABELS = Study(
    "labels",
    Labels,
    EXPLANATIONS,
    Job(
        "label",
        "trust_labels:compute",
        lambda c: {
            "pair": model_of(c),
            "tunings": grid_of(c.labels),
            "settings": without(c.labels, *GRID),
            "damping": "{damping}",
        },
        files=("labels/{damping}.nc",),
    ),
    results=of_dampings("labels/{damping}.nc"),
)

BRANCHES = Study(
    "branches",
    Branches,
    EXPLANATIONS,
    Job(
        "branches",
        "resonance_branches:of_damping",
        lambda c: {
            "damping": "{damping}",
            "pair": model_of(c),
            "settings": without(c.branches, "loci"),
        },
        files=("branches/{damping}.nc",),
    ),
    Job(
        "loci",
        "resonance_branches:loci_of",
        lambda c: {
            "pair": c.pair_parameters(c.branches.loci.damping),
            **c.branches.model_dump(include={"start", "stop"}),
            **c.branches.loci.model_dump(include={"lowest", "highest"}),
        },
        {"branches": lambda c: f"branches/{c.branches.loci.damping}.nc"},
        kernels=(),
    ),
    Drawing(
        "branches_figure.draw",
        {"branches": lambda c: f"branches/{c.branches.loci.damping}.nc", "loci": "loci.nc"},
        "branches",
        "Beside Fig. 3: folds and grazings, and what moves them",
        """Above: height of the orbits of one mesh period, and of two where they branch off,
        over the tuning for the damping {c.branches.loci.damping}, solid where stable, dashed
        where unstable. At a fold two orbits meet and vanish: a sweep jumps there. At a grazing
        the orbit just touches a flank line. Below: how these points move with the damping
        ratio; the dotted line is the damping of the picture above. Above the top of a line of
        grazings contact is no longer lost, or the far flank no longer reached; where two lines
        of folds meet, hysteresis ends.""",
    ),
)

CERTIFICATES = Study(
    "certificates",
    Certificates,
    EXPLANATIONS,
    Table(
        "certificates",
        "",
        {},
        "What is proven of the orbits: table",
        """What is proven, in ball arithmetic, by damping: orbits of one mesh period, ranges with
        an orbit without loss of contact at every tuning. Contacts: phases of normal mesh (N),
        backlash (B), inverse mesh (I); lowest: displacement in static deflections. All
        enclosures: certificates.json.""",
    ),
    results=lambda c: ["certificates.json"],
)

NONLINEAR_DAMPING = Study(
    "nonlinear_damping",
    NonlinearDamping,
    EXPLANATIONS,
    Job(
        "nonlinear_damping",
        "nonlinear_damping:compute",
        lambda c: {
            "pair": c.gear_pair.model_dump(),
            "settings": c.nonlinear_damping.model_dump(),
            "run": run_length(c),
            "samples_per_period": c.run.samples_per_period,
            "tunings": grid_of(c.nonlinear_damping),
            "place": "{place}",
            "power": "{power}",
        },
        files=("nonlinear_damping/{place}_{power}.nc",),
    ),
    Table(
        "nonlinear_damping",
        "nonlinear_damping:rows",
        {"studies": _places_and_powers},
        "Nonlinear damping: table",
        """Coefficients of equal dissipation, and for each direction of the sweep the jump, the
        highest displacement and the widest range of tunings with contact loss. nan: no jump. A
        jump is known to an interval, which is wider where rounding decides on which side of it
        motions end; its size is that between the tunings of the sweep beside it, nan where
        rounding decides of that too.""",
    ),
    Drawing(
        "nonlinear_damping_figure.draw",
        {"studies": _places_and_powers},
        "nonlinear_damping",
        "Nonlinear damping of equal work",
        """Linear, quadratic and cubic damping that dissipate the same work per period at the
        amplitude and tuning of the configuration. Above: sweeps up (lines) and down (pale);
        below: phase planes from rest. Left: damping of the material only; right: damping of the
        oil only.""",
    ),
)

MODELS = Study(
    "models",
    Models,
    EXPLANATIONS,
    Job(
        "compare_models",
        "model_comparison:compute",
        lambda c: {
            "cases": cases_of(c),
            "question": _question_of(c),
            "six_degrees": c.six_degree_parameters(),
            "harmonics": c.models.harmonics,
            "run": run_length(c),
            "starts": c.models.model_dump(include=STARTS),
        },
        files=("models/{scene}.nc",),
        kernels=("kernels", "larger_kernels"),
    ),
    Table(
        "models",
        "model_comparison:rows",
        {"comparisons": _of_scenes},
        "Models: table",
        """For each scene and model: the largest change of an observable that a larger model
        would make, the tolerance of the scene, the cost, and the smallest model that suffices.
        *differs*: rounding decides the runs.""",
        settings=_scenes,
        rule="model_table",
    ),
    Drawing(
        "models_figure.draw",
        {"comparisons": _of_scenes},
        "models",
        "Models: what larger ones would change",
        """Change that a larger model would make in the observables of each scene. Filled: the
        smallest model for which it is within the tolerance (dashed); this model suffices. Cost:
        components of the state that are computed per mesh period. ~: rounding decides the runs;
        bars are medians of {c.models.starts} seeded starts, lines their range, and the change
        has to be within the tolerance from all of them.""",
        _scenes,
    ),
    needs=lambda c: bool(c.scenes),
    refusal=bearings_of_scenes,
)

PARAMETRIC_RESONANCE = Study(
    "parametric_resonance",
    ParametricResonance,
    EXPLANATIONS,
    Job(
        "parametric_resonance",
        "tongue_chart:compute",
        lambda c: {
            "pair": c.gear_pair.model_dump(),
            "settings": without(c.parametric_resonance, "asked", *GRID),
            "tunings": grid_of(c.parametric_resonance),
        },
    ),
    Job(
        "tongues",
        "contact_loss:compute",
        lambda c: {
            "pairs": pairs_of(c),
            "tuning": c.parametric_resonance.asked,
            "start": c.parametric_resonance.start,
            "stop": c.parametric_resonance.stop,
            "run": {key: run_length(c)[key] for key in ("periods", "initial_state")},
        },
    ),
    Table(
        "parametric_resonance",
        "contact_loss:rows",
        {"tongues": "tongues.nc"},
        "Parametric resonance: the tuning in question",
        """What happens at tuning {c.parametric_resonance.asked}, by damping: the tongue next to
        it, from which damping ratio on it is closed; growth of deviations per mesh period, ln
        |multiplier|; the least displacement of the orbit without loss of contact; between which
        tunings around the motion from rest loses contact; from which tuning on that orbit
        leaves the flank itself. Cause: parametric instability where deviations grow, forced
        response where that orbit leaves the flank.""",
    ),
    Drawing(
        "parametric_resonance_figure.draw",
        {"chart": "parametric_resonance.nc", "facts": "tongues.nc"},
        "parametric_resonance",
        "Parametric resonance: tongues",
        """Stability of the motion without contact loss over the tuning and the stiffness ratio,
        the contact ratio, the damping. Instability tongues of order n lie near ν = 2/n. Shade:
        growth per mesh period without damping (below: with it); lines: edges of the tongues,
        coloured by damping, which rounds their tips and shrinks them. Circles: a tongue of zero
        width. Dashed: the pair; cross: the tuning of the table.""",
    ),
)
