"""Columns of the summary table of a run, each of which is a variable of datasets."""

from typing import NamedTuple

#: Ways in which a column combines values over time. Datasets divide a SUM, the integral over the
#: mesh phase, by the recorded phase, and a COUNT of events by the number of recorded mesh periods.
LARGEST, LEAST, SUM, COUNT = "largest", "least", "sum", "count"


class Column(NamedTuple):
    """Column of the summary table, which is a variable of datasets."""

    name: str  #: name of the variable
    kind: str  #: LARGEST, LEAST, SUM or COUNT
    description: str
    scale: str = ""  #: factor to SI units, static_deflection or force_scale; empty: dimensionless
    trains_only: bool = False  #: whether only datasets of gear trains have it

    @property
    def long_name(self) -> str:
        """The description, followed by the unit of dimensionless values, if any."""
        units = {"static_deflection": " in static deflections", "force_scale": " over load"}
        return self.description + units.get(self.scale, "")


#: `gearlib.engines.orbit` has a constant for the index of each column.
COLUMNS = (
    Column("displacement_max", LARGEST, "largest displacement", "static_deflection"),
    Column("displacement_min", LEAST, "smallest displacement", "static_deflection"),
    Column("dynamic_force_max", LARGEST, "largest dynamic mesh force", "force_scale"),
    Column("dynamic_force_min", LEAST, "smallest dynamic mesh force", "force_scale"),
    Column("fraction_drive", SUM, "fraction of time in drive-side contact"),
    Column("contact_loss_fraction", SUM, "fraction of time without contact"),
    Column("fraction_coast", SUM, "fraction of time in coast-side contact"),
    Column("fraction_min_stiffness", SUM, "fraction of time in mesh at the lower stiffness"),
    Column("bounces", COUNT, "losses of drive-side contact per mesh period"),
    Column("mean_force", SUM, "mean mesh force", "force_scale", trains_only=True),
)
