"""`make real-gearboxes`: read the REXS files in the folder of the variable REXS."""

import os
import sys
from pathlib import Path

import gearlib

folder = Path(os.environ.get("REXS", ""))
paths = sorted(
    x for x in folder.glob("*") if x.name.endswith((".rexs", ".rexsj", ".rexsz", ".zip"))
)
if not paths:
    sys.exit(f"There are no REXS files in {folder}: give their folder, as in make ... REXS=folder")
for path in paths:
    try:
        box = gearlib.read_gearbox(path)
        print(box, end="\n\n")
        train = box.train(model="rectangle", stiffness="iso")
        print(path.name, train.modes().natural_frequency.values.round(1), end="\n\n")
    except ValueError as error:
        print(f"{path.name} is refused: {error}\n")
