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
}
