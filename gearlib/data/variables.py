"""Names, units and descriptions of all variables of datasets.

Displacements are in units of the static deflection F / C_s, and time is the mesh phase tau in rad,
so that velocities are dx/dtau. The scale variables convert them to SI units.
"""

from gearlib.engines.summary_columns import COLUMNS

#: Coordinates that are indices, starting from 0.
_INDEX_COORDINATES = (
    "event start sample branch locus tongue point variation orbit attractor".split()
)
#: Name of a variable -> (CF units, long_name).
DESCRIPTIONS = {
    # coordinates
    **{name: ("1", f"number of the {name}") for name in _INDEX_COORDINATES},
    "phase": ("rad", "mesh phase, 2 pi per mesh period"),
    "tuning": ("1", "tuning nu, mesh frequency over mean eigenfrequency"),
    # time courses
    "displacement": ("1", "relative mesh displacement in static deflections"),
    "velocity": ("1", "relative mesh velocity dx/dtau in static deflections"),
    "acceleration": ("1", "relative mesh acceleration d2x/dtau2 in static deflections"),
    "stiffness": ("1", "mesh stiffness over mean mesh stiffness"),
    "modified_stiffness": ("1", "modified stiffness C (H1 + H2) over mean stiffness"),
    "dynamic_force": ("1", "dynamic mesh force over load"),
    "contact": ("1", "phase of contact"),
    # six degrees of freedom
    "rotation_3": ("1", "rotation of gear 3 as arc length on the base circle, static deflections"),
    "rotation_2": ("1", "rotation of gear 2 as arc length on the base circle, static deflections"),
    "bearing_y3": ("1", "motion of gear 3 along the line of action in static deflections"),
    "bearing_z3": ("1", "motion of gear 3 across the line of action in static deflections"),
    "bearing_y2": ("1", "motion of gear 2 along the line of action in static deflections"),
    "bearing_z2": ("1", "motion of gear 2 across the line of action in static deflections"),
    "bearing_force_y3": ("1", "force of the bearing of gear 3 along the line of action over load"),
    "bearing_force_z3": ("1", "force of the bearing of gear 3 across the line of action over load"),
    "bearing_force_y2": ("1", "force of the bearing of gear 2 along the line of action over load"),
    "bearing_force_z2": ("1", "force of the bearing of gear 2 across the line of action over load"),
    "coast_line": ("1", "line s of Eq. (4), where coast-side contact begins, static deflections"),
    "friction_force": ("1", "friction force across the line of action over load"),
    # gear trains
    "axis": ("1", "direction of the motion; rotation: as arc length on the base circle"),
    "mesh_force": ("N", "static mesh force, negative on the coast side"),
    "dynamic_factor": ("1", "dynamic factor, largest mesh force over its static value"),
    "peak_force_ratio": ("1", "largest mesh force over its static value, with a given stiffness"),
    "body_motion": ("1", "displacement of the body in static deflections"),
    "event_mesh": ("1", "number of the mesh in which the event is"),
    "load_sharing": (
        "1",
        "load sharing, mesh force over the mean of those of the same central gear",
    ),
    "body_displacement": ("m", "static displacement of the body"),
    "reference_phase": ("rad", "phase of the reference mesh"),
    "mode": ("1", "number of the natural mode"),
    "natural_frequency": ("Hz", "natural frequency at mean stiffness, all flanks in contact"),
    "mode_kind": ("1", "kind of the natural mode"),
    "mode_shape": ("1", "motion of the body in the natural mode, the largest of all 1"),
    "strain_energy": ("1", "share of the mesh in the strain energy of the natural mode"),
    "frequency": ("Hz", "frequency"),
    "response_amplitude": ("1", "output over input, in their SI units"),
    "response_phase": ("rad", "phase of the output to the input"),
    "modal_damping_ratio": ("1", "damping ratio of the natural mode by itself"),
    "complex_mode": ("1", "number of the damped mode"),
    "decay_rate": ("s-1", "rate of decay of the damped mode"),
    "damped_frequency": ("Hz", "frequency of the damped mode"),
    "mode_shape_real": ("1", "motion of the body in the damped mode, real part"),
    "mode_shape_imag": ("1", "motion of the body in the damped mode, imaginary part"),
    "shaft_energy": ("1", "share of the shaft in the strain energy of the natural mode"),
    "stiffness_order": ("1", "frequency of the stiffness over the reference mesh frequency"),
    "modal_force": ("N", "amplitude of stiffness times static deflection on the shape of the mode"),
    "phase_sum": ("1", "modal force over that of meshes all in phase"),
    "critical_speed": ("min-1", "speed at which the order meets the natural frequency"),
    "mesh_rate": ("1", "mesh frequency over that of the reference mesh"),
    "excites": ("1", "whether the stiffness excites the natural mode at this order"),
    "speed": ("min-1", "speed, of the gear whose revolutions count"),
    "mesh_branch": ("1", "branch of the mesh"),
    "mesh_stage": ("1", "stage of the mesh"),
    "lost_alone_share": ("1", "share of the starts in which only the branch loses contact"),
    "struck_alone_share": (
        "1",
        "share of the starts in which only the branch strikes coast-side flanks",
    ),
    "largest_ratio": ("1", "largest force over static force of all tunings with settled motions"),
    "largest_ratio_tuning": ("1", "tuning of the largest force"),
    "settled": ("1", "whether motions end on a stable orbit, in trains from all starts on one"),
    "settled_share": ("1", "share of the starts that end on a stable orbit"),
    "motion_count": ("1", "stable orbits on which starts end"),
    "largest_share": ("1", "share of the starts on the stable orbit that has most"),
    # where the gears of a train lie
    "body_x": ("m", "axis of the body without errors, at phase 0, counted from the first carrier"),
    "body_y": ("m", "axis of the body without errors, at phase 0, counted from the first carrier"),
    "body_radius": ("m", "largest working pitch radius; of a carrier that of its pins"),
    "body_turns": ("1", "rotation of the body in the housing over the phase of the reference mesh"),
    "shaft_line": ("1", "number of the line of shafts on which the body sits, 0: none"),
    "mesh_gear": ("1", "bodies that mesh"),
    "pitch_radius": ("m", "working pitch radius, of a ring gear negative"),
    "mesh_x": ("m", "pitch point at phase 0"),
    "mesh_y": ("m", "pitch point at phase 0"),
    "frame_turns": ("1", "rotation of all axes about the first over the reference mesh's phase"),
    "misfit": ("m", "by how much positions of one axis that are given in several ways differ"),
    # designs with tolerances
    "quantile": ("1", "share of the designs below"),
    "motion": ("1", "motion of a design on which a seeded start ends, of those met up and down"),
    "refusal": ("1", "why there is no such design, empty where there is one"),
    "run_count": ("1", "designs that ran"),
    "failed_runs": ("1", "designs whose run could not go on"),
    "contact_loss_probability": ("1", "share of the designs that lose contact"),
    "unsettled_share": ("1", "share of the designs whose motion has not settled"),
    "two_motions_probability": ("1", "share of the designs with two motions, met up and down"),
    "motion_probability": ("1", "share of the seeded starts that end on a motion"),
    "height_band": ("m", "quantiles of the peak-to-peak displacement"),
    "factor_band": ("1", "quantiles of the largest force over the load"),
    "factor": ("1", "largest force over the load"),
    "run_status": ("1", "how the run ended, -1 where there is no such design"),
    "bound": ("1", "end of the interval"),
    "first_index": ("1", "share of the variance by the parameter alone"),
    "total_index": ("1", "share of the variance by the parameter alone and with others"),
    "first_index_interval": ("1", "bootstrapped interval of the share by the parameter alone"),
    "total_index_interval": ("1", "bootstrapped interval of the share with others"),
    "missing_designs": ("1", "designs without the quantity"),
    # load sharing of pairs of teeth
    "tooth_pair": ("1", "pairs of teeth that came into mesh since"),
    "transmission_error": ("m", "static transmission error, approach along the line of action"),
    "load_share": ("1", "share of the pair of teeth in the load"),
    "pairs_in_contact": ("1", "number of pairs of teeth that touch"),
    "path_position": ("m", "position on the path of contact, radius of curvature of the pinion"),
    "gap": ("m", "gap that reliefs and deviations leave between the flanks of the pair"),
    "peak_to_peak_error": ("m", "peak-to-peak static transmission error"),
    "effective_contact_ratio": ("1", "effective contact ratio, mean number of pairs that touch"),
    "relief": ("1", "length of the optimum tip relief"),
    "relief_amount": ("m", "amount of the tip relief"),
    "design_torque": ("N m", "torque of the pinion for which the relief is optimum"),
    # order spectra
    "mesh_order": ("1", "frequency over mesh frequency"),
    "force_amplitude": ("N", "peak amplitude of the mesh force at the order; at 0 the mean"),
    "force_phase": ("rad", "phase of the mesh force at the order"),
    "force_amplitude_error": ("N", "estimated error of the amplitude of the mesh force"),
    "error_amplitude": ("m", "peak amplitude of the transmission error at the order; at 0 mean"),
    "error_phase": ("rad", "phase of the transmission error at the order"),
    "error_amplitude_error": ("m", "estimated error of the amplitude of the transmission error"),
    "mean_square_force": ("N2", "mean square of the mesh force, by samples"),
    "mean_square_error": ("m2", "mean square of the transmission error, by samples"),
    # gearboxes
    "corner_position": ("m", "corner of a section or gear"),
    "part_stage": ("1", "stage of the gear, empty for shafts"),
    "natural_mode": ("1", "number of the natural mode of the box"),
    "mode_frequency": ("Hz", "natural frequency of the box"),
    "mode_strain_energy": ("1", "share of the mesh in the strain energy of the natural mode"),
    "mode_shaft_energy": ("1", "share of the shaft in the strain energy of the natural mode"),
    # characteristic frequencies
    "hunting_tooth_frequency": ("Hz", "hunting tooth frequency, at which the same teeth meet"),
    "assembly_phase_frequency": ("Hz", "assembly phase frequency"),
    "sideband_spacing": ("Hz", "rate at which the gear turns past the line of centres"),
    "shaft_frequency": ("Hz", "frequency of rotation in the housing"),
    "planet_passing_frequency": ("Hz", "rate at which planets pass a tooth of the central gear"),
    # duty point
    "mesh_frequency_hertz": ("Hz", "mesh frequency"),
    "resonance_speed": ("min-1", "speed at tuning 1"),
    "operating_speed": ("min-1", "operating speed of the pinion"),
    "jump_up_speed": ("min-1", "speed above which the motion jumps, running up"),
    "jump_down_speed": ("min-1", "speed below which the motion jumps, running down"),
    "iso_dynamic_factor": ("1", "dynamic factor K_v of ISO 6336-1, method B"),
    "static_force": ("N", "static mesh force"),
    "mesh_force_max": ("N", "largest mesh force"),
    "mesh_force_min": ("N", "smallest mesh force, negative on the coast side"),
    "bearing": ("1", "gear that the bearings carry"),
    "bearing_force_max": ("N", "largest force of the bearings of a shaft together"),
    "error_peak_to_peak": ("m", "peak-to-peak dynamic transmission error"),
    "error_rms": ("m", "dynamic transmission error, root mean square about its mean"),
    "mesh_order_force": ("N", "peak amplitude of the mesh force"),
    "mesh_order_error": ("m", "peak amplitude of the dynamic transmission error"),
    # fits: values of parameters are in the unit that parameter_units has of each
    "parameter": ("1", "free parameter"),
    "fitted_value": ("1", "value, in parameter_units"),
    "stderr": ("1", "standard error, in parameter_units, NaN where the data do not tell"),
    "interval_low": ("1", "lower end of the interval of 95 %, in parameter_units"),
    "interval_high": ("1", "upper end of the interval of 95 %, in parameter_units"),
    "range_low": ("1", "lowest value allowed, in parameter_units"),
    "range_high": ("1", "highest value allowed, in parameter_units"),
    "initial_value": ("1", "value at the start, in parameter_units"),
    "identifiable": ("1", "whether the data tell the value"),
    "correlation": ("1", "correlation of the estimates"),
    "redchi": ("1", "reduced chi-square"),
    "aicc": ("1", "Akaike's information criterion, corrected for the number of data"),
    "bic": ("1", "Bayesian information criterion"),
    "ndata": ("1", "number of data"),
    # events
    "event_phase": ("rad", "mesh phase of the crossing of a flank line"),
    "event_from": ("1", "phase of contact before the event"),
    "event_to": ("1", "phase of contact after the event"),
    "event_velocity": ("1", "relative mesh velocity dx/dtau at the event"),
    # summary of the recorded orbit
    **{column.name: ("1", column.long_name) for column in COLUMNS},
    "period": ("1", "mesh periods after which the settled motion repeats, 0: not settled"),
    "followed": ("1", "mesh periods over which the motion was followed to settle"),
    "final_state": ("1", "displacement and dx/dtau at the end of the run, in static deflections"),
    "status": ("1", "how the run ended"),
    "evaluations": ("1", "evaluations of the right-hand side in the whole run"),
    # the jump of the motion from rest
    "kind": ("1", "what is varied"),
    "value": ("1", "value"),
    "height": ("1", "height of the orbit from rest in static deflections"),
    "jump": ("1", "tuning at which the orbit jumps"),
    "shift": ("1", "shift of the jump against the base"),
    "jump_interval": ("1", "width of the tuning interval to which the jump is known"),
    "switches": ("1", "large changes of height between neighbouring tunings of the scan"),
    # periodic orbits
    "state": ("1", "state at tau = 0 in static deflections and mesh phase"),
    "multiplier_real": ("1", "real part of the Floquet multipliers"),
    "multiplier_imaginary": ("1", "imaginary part of the Floquet multipliers"),
    "pattern": ("1", "phases of contact in the order met"),
    "stable": ("1", "whether no multiplier lies outside the unit circle"),
    "grazing": ("1", "whether the orbit touches a flank line"),
    "residual": ("1", "difference of the states at start and end"),
    "own_damping": ("1", "damping ratio of the pair whose branches they are"),
    "contacts": (
        "1",
        "phases of contact in cyclic order: D drive side, F free flight, C coast side",
    ),
    "orbit_height": ("1", "largest less smallest displacement in static deflections"),
    # parametric resonance
    "order": ("1", "half waves per mesh period, order of the tongue"),
    "tuning_from": ("1", "first tuning of the tongue"),
    "tuning_to": ("1", "last tuning of the tongue"),
    "edge_multiplier": ("1", "Floquet multiplier on the edges of the tongue, 0: complex"),
    "growth": ("1", "logarithm of the largest Floquet multiplier per mesh period"),
    "growth_tuning": ("1", "tuning of the largest growth in the tongue"),
    "closing_damping": ("1", "damping ratio from which the tongue stays closed"),
    "stiffness_ratio": ("1", "stiffness ratio kappa"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "damping": ("1", "damping: ratio beta while the flanks touch, or name of the combination"),
    "plane": ("1", "parameter beside the tuning"),
    "row": ("1", "number of the value"),
    "own_value": ("1", "value of the gear pair"),
    "point_value": ("1", "its value where an undamped tongue has width zero"),
    "point_tuning": ("1", "tuning where an undamped tongue has width zero"),
    "asked": ("1", "tuning in question"),
    "damping_ratio": ("1", "damping ratio beta while the flanks touch"),
    "nearest_order": ("1", "order of the tongue nearest to the tuning in question"),
    "orbit_min": ("1", "least displacement of the orbit without loss, static deflections"),
    "lost": ("1", "whether the motion from rest loses contact at the tuning in question"),
    "loss_from": ("1", "first tuning around at which the motion from rest loses contact"),
    "loss_to": ("1", "last tuning around at which the motion from rest loses contact"),
    "forced_from": ("1", "first tuning at which the orbit without loss leaves the flank"),
    "cause": ("1", "what makes contact be lost at the tuning in question"),
    # periodic motions over harmonics
    "harmonic": ("1", "number of the harmonic of the mesh phase"),
    "cosine": ("1", "cosine amplitude of the displacement in static deflections"),
    "sine": ("1", "sine amplitude of the displacement in static deflections"),
    "equation_residual": ("1", "largest residual of the balanced harmonics over the load"),
    "iterations": ("1", "Newton steps, or applications of the kernel"),
    "converged": ("1", "whether the iteration converged"),
    "degenerate": ("1", "harmonics of the degenerate kernel"),
    "terms": ("1", "real terms of the degenerate kernel"),
    "norm_bound": ("1", "bound of the norm of the remainder along the motion"),
    "contraction": ("1", "factor by which an iteration shrinks deviations"),
    "displacement_error": ("1", "largest error of the displacement in static deflections"),
    "velocity_error": ("1", "largest error of dx/dtau in static deflections"),
    # the analytic method
    "balance_harmonics": ("1", "harmonics, harmonic balance"),
    "balance_displacement_error": ("1", "largest error of the displacement, harmonic balance"),
    "balance_velocity_error": ("1", "largest error of dx/dtau, harmonic balance"),
    "schmidt_harmonics": ("1", "harmonics, E. Schmidt's method"),
    "schmidt_displacement_error": ("1", "largest error of the displacement, E. Schmidt's method"),
    "schmidt_velocity_error": ("1", "largest error of dx/dtau, E. Schmidt's method"),
    "iteration": ("1", "iteration, applications of the kernel to the motion"),
    "contact_loss": ("1", "whether contact is lost"),
    "degenerate_count": ("1", "degenerate harmonics"),
    "degenerate_chosen": ("1", "degenerate harmonics, chosen automatically"),
    "automatic": ("1", "degenerate harmonics, chosen automatically"),
    "iterate_displacement": ("1", "displacement of an iterate in static deflections"),
    "iterate_error": ("1", "largest error of an iterate's displacement in static deflections"),
    "algebraic_step": ("1", "whether a step of the degenerate part follows the iterate"),
    "exact_displacement": ("1", "displacement of the exact orbit in static deflections"),
    "balance_max": ("1", "largest displacement by harmonic balance in static deflections"),
    "balance_min": ("1", "smallest displacement by harmonic balance in static deflections"),
    # global picture
    "attractor_kind": ("1", "kind of the attractor"),
    "basin": ("1", "number of the attractor to which an initial state comes"),
    "share": ("1", "share of the initial states that come to the attractor"),
    "share_error": ("1", "standard error of the share of as many random initial states"),
    "trap_radius": ("1", "smallest ellipse around the orbit that no sampled direction leaves"),
    "attractor_family": ("1", "number of the family of attractors"),
    "coordinate": ("1", "number of the coordinate of the state"),
    "multiplier": ("1", "number of the Floquet multiplier"),
    "chaotic": ("1", "whether deviations from the orbit grow exponentially"),
    "strobe": ("1", "mesh period of the stroboscopic state"),
    "backlash_damping": ("1", "damping ratio of the oil in free flight"),
    # numerical stability
    "steps": ("1", "steps per mesh period"),
    "radius": ("1", "spectral radius of one mesh period of the method"),
    "true_radius": ("1", "spectral radius of one mesh period of the mesh"),
    "stiffness_max": ("1", "largest stiffness over mean mesh stiffness"),
    # trust
    "run": ("1", "how the point was run"),
    "label": ("1", "what the motion is"),
    "digits": ("1", "decimal digits to which all runs agree"),
    "exponent": ("1", "largest Lyapunov exponent per mesh period"),
    "uncertainty": ("1", "standard error of the exponent"),
    "fine_tuning": ("1", "tuning of the exact spectral radius"),
    # phase lag
    "lag": ("degree", "lag of the motion behind the mesh stiffness"),
    "first_lag": ("degree", "lag of the first harmonic behind the mesh stiffness"),
    "shown_tuning": ("1", "tuning nu, of the courses"),
    # nonlinear damping
    "direction": ("1", "direction of the sweep"),
    "place": ("1", "where the damping acts"),
    "power": ("1", "power of the velocity in the damping force"),
    "shown": ("1", "tuning nu, of the phase planes"),
    "coefficient": ("1", "damping coefficient"),
    "jump_size": ("1", "change of the orbit's height at the jump in static deflections"),
    "peak": ("1", "largest displacement of the characteristic in static deflections"),
    "peak_tuning": ("1", "tuning of the largest displacement"),
    "lost_from": ("1", "first tuning of the widest range with contact loss"),
    "lost_to": ("1", "last tuning of the widest range with contact loss"),
    "contact_loss_fraction": ("1", "fraction of time in which no flank touches"),
    "transient_periods": ("1", "mesh periods before the record"),
    "record_periods": ("1", "mesh periods of the record"),
    "torque": ("N m", "torque, of the pinion, of gear 3, load torque of each body of a train"),
    # comparison of models
    "change": ("1", "largest change of an observable that a larger model makes"),
    "cost": ("1", "components of the state that are computed per mesh period"),
    "losing_share": ("1", "share of the starts from which contact is lost"),
    "free_of_rounding": ("1", "whether rounding does not decide the run"),
    "change_free_of_rounding": ("1", "whether rounding decides none of the runs compared"),
    "chosen": ("1", "smallest model that suffices for the scene"),
    "tolerance": ("1", "largest change that counts as none"),
    "harmonics": ("1", "harmonics of the truncated stiffness"),
    # mesh stiffness of gears given by geometry
    "stiffness_phase": ("rad", "mesh phase of the stiffness, 0 in the middle of double contact"),
    "mesh_stiffness": ("N m-1", "mesh stiffness, dF/dx"),
    "mean_mesh_stiffness": ("N m-1", "mean mesh stiffness by the method"),
    "own_stiffness_ratio": ("1", "stiffness ratio kappa by the method"),
    "method_uncertainty": ("1", "relative uncertainty of the method"),
    "published": ("1", "source of a published mean stiffness"),
    "published_stiffness": ("N m-1", "published mean stiffness"),
    # trials of methods on difficult problems
    "verdict": ("1", "verdict on the method"),
    "error": ("1", "error in the quantity that is compared"),
    "periods": ("1", "mesh periods of the run"),
    "judge": ("1", "method of the reference"),
    "words": ("1", "the problem in words"),
    # errors of methods and what they cost
    "rung": ("1", "index of the setting: a line and a value of its accuracy parameter"),
    "line": ("1", "method, and how it is used"),
    "knob": ("1", "accuracy parameter and its value"),
    "orbit_state": ("1", "displacement and dx/dtau of the settled orbit at phase 0"),
    "largest_multiplier": ("1", "largest absolute Floquet multiplier of the orbit"),
    "state_error": ("1", "error of the final state, displacement in static deflections or dx/dtau"),
    "event_error": ("rad", "largest error of the phases of the recorded events"),
    "multiplier_error": ("1", "error of the largest absolute Floquet multiplier"),
    "period_evaluations": ("1", "evaluations of the right-hand side per mesh period"),
    "state_floor": ("1", "half the last place of the final state"),
    "event_floor": ("rad", "half the last place of the phase of the last event"),
    "multiplier_floor": ("1", "half the last place of the state over the width of differences"),
    "period_time": ("s", "wall time per mesh period"),
    "closed_form_time": ("s", "wall time of one evaluation of the closed form of contact"),
    # scales to SI
    "static_deflection": ("m", "static deflection, scale of displacements"),
    "mesh_frequency": ("rad s-1", "angular mesh frequency, phase over time"),
    "velocity_scale": ("m s-1", "scale of velocities"),
    "acceleration_scale": ("m s-2", "scale of accelerations"),
    "force_scale": ("N", "load, scale of forces"),
    "stiffness_scale": ("N m-1", "mean mesh stiffness, scale of stiffnesses"),
    "backlash_ratio": ("1", "backlash in static deflections"),
    "tuning_factor_max": ("1", "tuning towards the maximum stiffness over tuning"),
    "tuning_factor_min": ("1", "tuning towards the minimum stiffness over tuning"),
}

#: Variable of a run -> scalar variable of the same dataset that converts it to SI units.
SI_SCALES = {
    "displacement": "static_deflection",
    "velocity": "velocity_scale",
    "acceleration": "acceleration_scale",
    "dynamic_force": "force_scale",
    "stiffness": "stiffness_scale",
}

#: Quantity of a design with tolerances -> (CF units, long_name).
QUANTITIES = {
    "jump_up": ("min-1", "speed of the jump of the main resonance, running up"),
    "jump_down": ("min-1", "speed at which the main resonance falls, running down"),
    "onset_of_contact_loss": ("min-1", "speed at which contact is first lost, running up"),
    "peak": ("m", "largest displacement of the main resonance, up to its first fold"),
    "resonance_force_ratio": ("1", "largest mesh force over load, up to the same fold"),
    "dynamic_factor": ("1", "dynamic factor of pairs of teeth at the duty point"),
    "peak_force_ratio": ("1", "largest mesh force over its static value at the duty point"),
    "force": ("N", "largest mesh force at the duty point"),
    "transmission_error": ("m", "transmission error from peak to peak at the duty point"),
    "contact_margin": ("m", "least displacement at the duty point, below 0 contact is lost"),
    "load_sharing": ("1", "largest mean force of a mesh over that of its branches, duty point"),
    "least_load_sharing": ("1", "least mean force of a mesh over that of its branches, duty point"),
}

#: Suffixes of variables for the range over several initial states, with their descriptions.
_RANGE_SUFFIXES = {"low": "least of all starts", "high": "most of all starts"}
CONTACTS = ("coast", "no_contact", "drive")
STATUSES = ("ok", "event_limit", "unbounded", "not_converged", "stalled", "jammed", "unresolved")
STATUSES += ("no_start",)
#: Variable of integer codes -> (first code, names of the codes).
_CODES = {
    "contact": (-1, CONTACTS),
    "event_from": (-1, CONTACTS),
    "event_to": (-1, CONTACTS),
    "status": (0, STATUSES),
}


def _units_and_long_name(name, is_text):
    """Return (CF units, long_name) of the variable `name`.

    The suffixes ``_low`` and ``_high`` mark the range of a variable over several initial states. If
    `is_text`, i.e. for a string variable, the name is the default description. Raise KeyError for
    any other variable without a description.
    """
    base_name, _, suffix = name.rpartition("_")
    if name not in DESCRIPTIONS and suffix in _RANGE_SUFFIXES:
        units, long_name = DESCRIPTIONS[base_name]
        return units, f"{long_name}, {_RANGE_SUFFIXES[suffix]}"
    if name not in DESCRIPTIONS and is_text:
        return "1", name.replace("_", " ")
    return DESCRIPTIONS[name]


def add_metadata(dataset, model=None):
    """Add the attributes units, long_name and flag_meanings to all variables of `dataset`.

    The dataset is changed in place and returned. If a `model` is given, ``model.long_names``
    overrides descriptions. Variables that already have units are skipped. Raise KeyError if a
    numeric variable has no description.
    """
    model_names = {} if model is None else model.long_names
    for name, variable in dataset.variables.items():
        if "units" in variable.attrs:
            continue
        is_text = variable.dtype.kind in "OUST"  # NumPy kinds of objects and strings
        units, long_name = _units_and_long_name(name, is_text)
        if not is_text:
            variable.attrs["units"] = units
        variable.attrs["long_name"] = model_names.get(name, long_name)
        if name in _CODES:
            first_code, meanings = _CODES[name]
            codes = range(first_code, first_code + len(meanings))
            variable.attrs["flag_values"] = variable.dtype.type(codes)
            variable.attrs["flag_meanings"] = " ".join(meanings)
    return dataset
