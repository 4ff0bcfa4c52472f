"""gearlib: an open laboratory for the nonlinear dynamics of gear meshes.

========================  ============================================================
module                    responsibility
========================  ============================================================
``pair``                  parameters of a gear pair; the border between SI and ratios
``stiffness``             mesh stiffness over one mesh period, Eq. (1) and (2)
``contact``               flank lines, phases of contact, mesh force
``core``                  compiled kernels: closed forms, crossings, march
``simulation``            `simulate`: one tuning, time course, events, orbit summary
``sweeping``              `sweep`: many tunings, orbit summaries
``variational``           maps of small deviations over mesh periods
``orbits``                periodic orbits, their branches, folds, doublings, grazings
``branches``              the branches behind Fig. 3, and loci of their special points
``parametric_resonance``  tongues: where contact without loss is unstable
``frequency_domain``      periodic motions over harmonics: `schmidt`, `harmonic_balance`
``lyapunov``              largest Lyapunov exponent of a motion
``global_dynamics``       attractors and their basins, sections, bifurcation diagrams
``labelling``             `trust`: chaos or artefact: one point run in several ways
``harmonics``             periodic functions of the mesh phase
``profiles``              rectangular, Fourier and tabulated mesh stiffness
``models``                one file per model: its equation, its symbols
``integrators``           one file per method behind ``method=``
``arguments``             arguments that all runs share, checked
``summary``               from the summary table of the kernels to named variables
``variables``             names, units and descriptions of every variable
``status``                how a run ended, and what to do when it could not go on
``provenance``            what a dataset says of its own making
``storage``               datasets to and from netCDF
``files``                 whole files or none
``version``               the version of the library
``checks``                checks of single values, with their messages
``config``                the typed model of ``config.yaml``
``validation``            problems of a configuration in words
``tunings``               grids of tunings, and their windows
``gathering``             shards of the workflow into one dataset per experiment
``phase_lag``             lag of the motion behind the mesh stiffness
``jump``                  where the motion from rest jumps, and what moves the jump
``nonlinear_damping``     equivalent linear, quadratic and cubic damping side by side
``analytic_method``       the paper's analytic method at work, against exact orbits
``model_comparison``      what larger models would change in a scene, and what they cost
``scenes``                the time courses of a few runs, side by side
``claims``                the paper's statements, checked against computed data
``trials``                which method is right, at what cost, and where each fails
``figures``               one file per figure, functions that return a `Figure`
``reporting``             the report: tables as pages, a page to choose tunings on
``explorer``              sliders in the browser, and what the gear mesh makes of them
``cli``                   the command ``gearlib``
========================  ============================================================

The names below are loaded on first use, so that reading a configuration does
not pay for the numerical stack.
"""

from importlib import import_module

_PUBLIC = {
    "DeadZoneOscillator": "models.dead_zone",
    "Fourier": "profiles",
    "GearPair": "pair",
    "Harmonics": "harmonics",
    "OneDegreePair": "models.one_degree",
    "Rectangular": "profiles",
    "Series": "profiles",
    "SixDegreePair": "models.six_degrees",
    "Steps": "profiles",
    "Tabulated": "profiles",
    "__version__": "version",
    "basin_stability": "global_dynamics.basin_stability",
    "basins": "global_dynamics.basins",
    "bifurcation_diagram": "global_dynamics.bifurcation",
    "continue_orbit": "orbits.continuation",
    "harmonic_balance": "frequency_domain.harmonic_balance",
    "locus": "orbits.loci",
    "lyapunov_exponents": "global_dynamics.exponents",
    "methods": "integrators",
    "periodic_orbit": "orbits.shooting",
    "poincare_section": "global_dynamics.poincare",
    "schmidt": "frequency_domain.schmidt",
    "simulate": "simulation",
    "sweep": "sweeping",
    "switch_branch": "orbits.continuation",
    "tongues": "parametric_resonance",
    "trust": "labelling",
}

__all__ = [
    "DeadZoneOscillator",
    "Fourier",
    "GearPair",
    "Harmonics",
    "OneDegreePair",
    "Rectangular",
    "Series",
    "SixDegreePair",
    "Steps",
    "Tabulated",
    "basin_stability",
    "basins",
    "bifurcation_diagram",
    "continue_orbit",
    "harmonic_balance",
    "locus",
    "lyapunov_exponents",
    "methods",
    "periodic_orbit",
    "poincare_section",
    "schmidt",
    "simulate",
    "sweep",
    "switch_branch",
    "tongues",
    "trust",
]


def __getattr__(name):
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted([*globals(), *_PUBLIC])
