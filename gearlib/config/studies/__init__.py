"""The studies: one record for each, of which sections, targets, rules and captions are made.

====================  =======================================================
module                responsibility
====================  =======================================================
``study``             the record, and what records take from a configuration
``paper_figures``     the paper's figures and statements
``explained``         models, jump, branches, proofs, tongues
``basins_and_chaos``  basins, bifurcation diagram, Poincare sections
``of_methods``        analytic methods, and trials of all methods
``of_trains``         reducer, its Campbell diagram, a train over speed
``of_drawn_gears``    mesh stiffness, Harris maps
``of_rigs``           measured curves
``of_tolerances``     how sure jumps, contact loss and peaks are
====================  =======================================================
"""

from gearlib.config.studies import (
    basins_and_chaos,
    explained,
    of_drawn_gears,
    of_methods,
    of_rigs,
    of_tolerances,
    of_trains,
    paper_figures,
)
from gearlib.config.studies.study import Study

_MODULES = (
    paper_figures,
    explained,
    basins_and_chaos,
    of_methods,
    of_trains,
    of_drawn_gears,
    of_rigs,
    of_tolerances,
)

#: name -> `Study`, in the order of the targets.
STUDIES = {
    value.name: value
    for module in _MODULES
    for value in vars(module).values()
    if isinstance(value, Study)
}
