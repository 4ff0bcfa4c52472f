"""The variables of a summary: what each column of the summary table of a run holds."""

from typing import NamedTuple

#: How a column combines over time: the largest or the least value, an integral over the mesh phase,
#: which datasets divide by the phase of the record, or a number of events, by its mesh periods.
LARGEST, LEAST, SUM, COUNT = "largest", "least", "sum", "count"


class Column(NamedTuple):
    """A column of the summary table, a variable of datasets."""

    name: str  #: of the variable
    kind: str  #: LARGEST, LEAST, SUM or COUNT
    description: str
    scale: str = ""  #: variable that converts it to SI units, static_deflection or force_scale
    trains_only: bool = False  #: whether only datasets of gear trains have it

    @property
    def long_name(self) -> str:
        """The description with the unit of dimensionless values."""
        units = {"static_deflection": " in static deflections", "force_scale": " over load"}
        return self.description + units.get(self.scale, "")


#: `gearlib.engines.orbit` names the indices of these columns.
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
