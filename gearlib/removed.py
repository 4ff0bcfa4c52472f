"""Names, keys, options and targets of gearlib 0.2 that 0.3 no longer has."""

#: Sentence about the replacement -> removed names, keys, options and targets.
_REPLACEMENTS = {
    "gearlib.sensitivities differentiates any result": (
        "fold_sensitivities, orbit_sensitivities, failures.gradients"
    ),
    "certify and certify_range prove orbits, continue_orbit and tongues compute the rest": (
        "certify_fold, certify_grazing, certify_motion, certify_tongues"
    ),
    "scatter and sobol_indices tell what tolerances do": (
        "certify_box, first_order_scatter, tighten, kept_contact"
    ),
    "fit starts from the values of the model, once for each model": (
        "compare_fits, fit --starts, fit --seed, fit.starts, fit.seed"
    ),
    "order_map takes single orders": "order_track",
    "heyoka and scipy are methods of other packages": "cvode, diffrax",
    "look at the signal": "channels.bits, channels.limits",
    "duty_point gives the dynamic factor at one speed": "relief_dynamics",
    "the target mesh_stiffness compares stiffnesses": "rectangle",
    "failures and work_precision compare methods": "jump_by_method",
    "the target reducer shows the motions of the train": "one_mesh",
    "tongues, simulate and sweep take any train, the section train describes one": (
        "symmetry_breaking, train_chart, planetary"
    ),
    "snakemake --report makes the report": "report_page",
}
#: Removed name -> sentence about its replacement.
REMOVED = {name: text for text, names in _REPLACEMENTS.items() for name in names.split(", ")}


def removal_message(name):
    """Return the error message for a removed name of the library, a key, an option or a target."""
    return f"{name} was removed in gearlib 0.3: {REMOVED[name]}; see docs/migration.md"
