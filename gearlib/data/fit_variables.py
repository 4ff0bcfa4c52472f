"""Names, units and descriptions of what a dataset of a fit holds.

Values of parameters are in the unit that ``parameter_units`` has of each.
"""

_OWN = "in parameter_units"

#: name -> (CF units, long_name)
DESCRIPTIONS = {
    "parameter": ("1", "free parameter"),
    "other_parameter": ("1", "free parameter it is correlated with"),
    "parameter_units": ("1", "SI unit of the parameter"),
    "fitted_value": ("1", f"value, {_OWN}"),
    "stderr": ("1", f"standard error, {_OWN}, NaN where the data do not tell"),
    "interval_low": ("1", f"lower end of the interval of 95 %, {_OWN}"),
    "interval_high": ("1", f"upper end of the interval of 95 %, {_OWN}"),
    "range_low": ("1", f"lowest value allowed, {_OWN}"),
    "range_high": ("1", f"highest value allowed, {_OWN}"),
    "initial_value": ("1", f"value at the start, {_OWN}"),
    "identifiable": ("1", "whether the data tell the value"),
    "correlation": ("1", "correlation of the estimates"),
    "redchi": ("1", "reduced chi-square"),
    "aicc": ("1", "Akaike's information criterion, corrected for the number of data"),
    "bic": ("1", "Bayesian information criterion"),
    "ndata": ("1", "number of data"),
}
