"""gearlib: an open laboratory for the nonlinear dynamics of gear meshes.

===============  ================================================================================
room             responsibility
===============  ================================================================================
``models``       what can be simulated: parameters, mesh stiffness, equations of motion
``engines``      exact runs from event to event; compiled, one folder for each kind of system
``data``         from tables of numbers to named datasets and files
``integrators``  what stands behind ``method=``: own propagators, and solvers of other packages
``runs``         `simulate`, `sweep`, maps of small deviations
``analysis``     periodic orbits, instability tongues, harmonics, attractors, `trust`
``studies``      what stands behind one figure or table: scenes, the jump, the paper's statements
``uncertainty``  measured sets, fits, tolerances: `read_measured`, `fit`, `scatter`
``figures``      one file per figure, functions that return a `Figure`
``explorer``     the page with sliders
``cli``          the command ``gearlib``
``config``       the typed model of ``config.yaml``
===============  ================================================================================

Beside them lie ``geometry``, the public names of gears by their drawing, ``plot``, pictures of any
dataset, ``checks`` of single values, ``notebook``, bars of progress in Jupyter, ``processor``, the
instruction set of jobs, ``tunings`` and their names, ``version``. The names below are loaded on
first use, so that reading a configuration does not pay for the numerical stack.
"""

from importlib import import_module

_PUBLIC = {
    "Body": "models.trains.elements",
    "DeadZoneOscillator": "models.one_degree",
    "Fourier": "models.profiles",
    "GearPair": "models.pair",
    "GearTrain": "models.trains.train",
    "Harmonics": "models.harmonics",
    "LoadSharingPair": "models.load_sharing_pair",
    "Mesh": "models.trains.elements",
    "OneDegreePair": "models.one_degree",
    "Rectangular": "models.profiles",
    "Series": "models.profiles",
    "Shaft": "models.trains.elements",
    "SixDegreePair": "models.six_degrees",
    "Steps": "models.profiles",
    "Tabulated": "models.profiles",
    "__version__": "version",
    "basin_stability": "analysis.global_dynamics.basins",
    "basins": "analysis.global_dynamics.basins",
    "bifurcation_diagram": "analysis.global_dynamics.poincare",
    "certify": "analysis.proofs.orbits",
    "certify_range": "analysis.proofs.orbits",
    "continue_orbit": "analysis.orbits.continuation",
    "duty_point": "analysis.duty_point",
    "fit": "uncertainty.fits",
    "harmonic_balance": "analysis.harmonics.harmonic_balance",
    "idler": "models.trains.ready_made",
    "locus": "analysis.orbits.loci",
    "lyapunov_exponents": "analysis.lyapunov",
    "methods": "integrators",
    "order_map": "analysis.order_maps",
    "orders": "analysis.order_maps",
    "periodic_orbit": "analysis.orbits.shooting",
    "planetary": "models.trains.planetary",
    "poincare_section": "analysis.global_dynamics.poincare",
    "read_measured": "uncertainty.measured",
    "run_up": "runs.run_up",
    "scatter": "uncertainty.scatter",
    "schmidt": "analysis.harmonics.schmidt",
    "sensitivities": "analysis.sensitivities",
    "simulate": "runs.simulation",
    "sobol_indices": "uncertainty.indices",
    "split_power_reducer": "models.trains.ready_made",
    "sweep": "runs.sweeping",
    "switch_branch": "analysis.orbits.continuation",
    "tongues": "analysis.tongues.search",
    "trust": "analysis.trust",
    "two_stage": "models.trains.ready_made",
}

__all__ = [
    "Body",
    "DeadZoneOscillator",
    "Fourier",
    "GearPair",
    "GearTrain",
    "Harmonics",
    "LoadSharingPair",
    "Mesh",
    "OneDegreePair",
    "Rectangular",
    "Series",
    "Shaft",
    "SixDegreePair",
    "Steps",
    "Tabulated",
    "basin_stability",
    "basins",
    "bifurcation_diagram",
    "certify",
    "certify_range",
    "continue_orbit",
    "duty_point",
    "fit",
    "harmonic_balance",
    "idler",
    "locus",
    "lyapunov_exponents",
    "methods",
    "order_map",
    "orders",
    "periodic_orbit",
    "planetary",
    "poincare_section",
    "read_measured",
    "run_up",
    "scatter",
    "schmidt",
    "sensitivities",
    "simulate",
    "sobol_indices",
    "split_power_reducer",
    "sweep",
    "switch_branch",
    "tongues",
    "trust",
    "two_stage",
]


def __getattr__(name):
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    removed = import_module(f"{__name__}.removed")
    if name in removed.REMOVED:
        raise AttributeError(removed.sentence(name))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted([*globals(), *_PUBLIC])
