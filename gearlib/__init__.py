"""gearlib: an open laboratory for the nonlinear dynamics of gear meshes.

===============  ================================================================================
folder           responsibility
===============  ================================================================================
``gearboxes``    gearboxes from REXS files: `read_gearbox`
``models``       models that can be simulated: parameters, mesh stiffness, equations of motion
``engines``      compiled exact runs from event to event; one folder per kind of system
``data``         named datasets and files: names and units, netCDF, CSV
``integrators``  the values of ``method=``: propagators, and solvers of other packages
``runs``         `simulate`, `sweep`, `run_up`
``analysis``     periodic orbits, instability tongues, harmonics, attractors, `trust`
``studies``      computations, each for one figure or table
``uncertainty``  measured sets, fits, tolerances: `read_measured`, `fit`, `scatter`
``figures``      functions that return a `Figure`, one file per subject
``explorer``     the page with sliders
``cli``          the command ``gearlib``
``fmu``          gear trains as FMUs, which run without Python: `write_fmu`
``config``       the typed model of ``config.yaml``
===============  ================================================================================

Modules beside these folders: ``geometry`` (the public names for gears given by geometry),
``train_files``, ``plot`` (pictures of any dataset), ``checks`` (of single values), ``colours`` (of
categories), ``progress`` (progress bars and time limits of long calls), ``processor`` (the
instruction set of jobs), ``tunings`` (grids and file names) and ``version``. The public names are
imported on first use, so that reading a configuration does not load the numerical stack.
"""

from importlib import import_module

#: Module -> its public names.
_MODULES = {
    "analysis.characteristic_frequencies": "characteristic_frequencies",
    "analysis.duty_point": "duty_point",
    "analysis.global_dynamics.basins": "basin_stability basins",
    "analysis.global_dynamics.poincare": "bifurcation_diagram poincare_section",
    "analysis.harmonics.harmonic_balance": "harmonic_balance",
    "analysis.harmonics.schmidt": "schmidt",
    "analysis.lyapunov": "lyapunov_exponents",
    "analysis.orbits.continuation": "continue_orbit switch_branch",
    "analysis.orbits.loci": "locus",
    "analysis.orbits.shooting": "periodic_orbit",
    "analysis.order_maps": "order_map orders",
    "analysis.proofs.orbits": "certify certify_range",
    "analysis.sensitivities": "sensitivities",
    "analysis.tongues.search": "tongues",
    "analysis.trust": "trust",
    "fmu": "write_fmu",
    "gearboxes.gearbox": "Gearbox read_gearbox",
    "integrators": "methods",
    "models.harmonics": "Harmonics",
    "models.load_sharing_pair": "LoadSharingPair",
    "models.one_degree_pair": "DeadZoneOscillator OneDegreePair",
    "models.pair": "GearPair",
    "models.profiles": "Fourier Rectangular Series Steps Tabulated",
    "models.six_degrees": "SixDegreePair",
    "models.trains.matrices": "GearNode",
    "models.trains.elements": "Body HarmonicForce Mesh Shaft",
    "models.trains.linear_systems": "frequency_response state_space",
    "models.trains.planetary": "planetary",
    "models.trains.ready_made": "idler split_power_reducer two_stage",
    "models.trains.train": "GearTrain",
    "runs.run_up": "run_up",
    "runs.simulation": "simulate",
    "runs.sweeping": "sweep",
    "train_files": "read_train write_train",
    "uncertainty.fits": "fit",
    "uncertainty.measured": "read_measured",
    "uncertainty.scatter": "scatter sobol_indices",
    "version": "__version__",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}
__all__ = [name for name in sorted(_PUBLIC) if name != "__version__"]


def __getattr__(name):
    """Import a public name from its module when it is first used.

    `_PUBLIC` maps each public name to the module that defines it.
    """
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    """Return the names of this package, including those that are not imported yet."""
    return sorted([*globals(), *_PUBLIC])
