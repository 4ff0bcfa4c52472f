"""Units and descriptions of what scatters with the tolerances of a drawing."""

#: name -> (CF units, long_name)
DESCRIPTIONS = {
    "sample": ("1", "number of the sample"),
    "parameter": ("1", "name of the parameter that scatters"),
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
    "height": ("m", "peak-to-peak displacement"),
    "factor": ("1", "largest force over the load"),
    "lost": ("1", "whether contact is lost"),
    "settled": ("1", "whether the motion has settled"),
    "run_status": ("1", "how the run ended, -1 where there is no such design"),
    "bound": ("1", "end of the interval"),
    "first_index": ("1", "share of the variance by the parameter alone"),
    "total_index": ("1", "share of the variance by the parameter alone and with others"),
    "first_index_interval": ("1", "bootstrapped interval of the share by the parameter alone"),
    "total_index_interval": ("1", "bootstrapped interval of the share with others"),
    "missing_designs": ("1", "designs without the quantity"),
}

#: The same of the quantities of each design, see `gearlib.uncertainty.design_quantities`.
QUANTITIES = {
    "jump_up": ("min-1", "speed of the jump of the main resonance, running up"),
    "jump_down": ("min-1", "speed at which the main resonance falls, running down"),
    "onset_of_contact_loss": ("min-1", "speed at which contact is first lost, running up"),
    "peak": ("m", "largest displacement of the main resonance, up to its first fold"),
    "peak_dynamic_factor": (
        "1",
        "largest mesh force over load of the main resonance, up to its first fold",
    ),
    "dynamic_factor": ("1", "largest mesh force over its static value at the duty point"),
    "force": ("N", "largest mesh force at the duty point"),
    "transmission_error": ("m", "transmission error from peak to peak at the duty point"),
    "contact_margin": ("m", "least displacement at the duty point, below 0 contact is lost"),
    "load_sharing": ("1", "largest mean force of a mesh over that of its branches, duty point"),
    "least_load_sharing": ("1", "least mean force of a mesh over that of its branches, duty point"),
}
