"""Measured sets in the workflow: laid over its curves, scored, refused before any job."""

import csv

import pytest
import xarray as xr
import yaml

pytestmark = pytest.mark.slow

SWEEPS = {
    "data": "sweeps.csv",
    "source": "computed by the test, synthetic",
    "licence": "own data",
    "synthetic": True,
    "channels": {
        "n": {"observableId": "speed", "unit": "rpm"},
        "to": {"observableId": "direction", "unit": 1},
        "top": {"observableId": "displacement_max", "unit": "um", "noise": 0.1},
    },
}


def test_a_measured_set_reruns_what_uses_it_and_is_refused_first(project):
    found = xr.load_dataset(project / "results/resonance.nc").sel(damping="k1")
    rows = [
        f"{n},{way},{x * float(found.static_deflection) * 1e6}\n"
        for way in ("up", "down")
        for n, x in zip(
            found.speed.values, found.displacement_max.sel(direction=way).values, strict=True
        )
    ]
    (project / "rig").mkdir()
    (project / "rig/sweeps.yaml").write_text(yaml.safe_dump(SWEEPS))
    table = project / "rig/sweeps.csv"
    table.write_text("n,to,top\n" + "".join(rows))
    project.configure(lambda settings: settings.update(measured=["rig/sweeps.yaml"]))
    uses = {"measured_curve": 1, "measured_table": 1, "draw_resonance": 1}
    assert project.jobs("-j2", "measured", "resonance") == uses | {"measured": 1, "resonance": 1}
    with open(project / "results/measured.csv", newline="") as file:
        scores = {(row["damping"], row["quantity"]): row for row in csv.DictReader(file)}
    free = "misfit of displacement_max over its range, free gain and offset"
    assert float(scores["k1", free]["computed"]) < 1e-6 < float(scores["k1m", free]["computed"])
    assert scores["k1", free]["quantity"] in (project / "results/tables/measured.html").read_text()
    # An edit of the table reruns what uses it; one that cannot be read stops all before.
    table.write_text(table.read_text() + f"{float(found.speed[-1]) - 1.0},up,11\n")
    assert project.planned("measured", "resonance") == uses | {"measured": 1, "resonance": 1}
    table.write_text(table.read_text() + "3000,up,nan\n")
    refusal = project.snakemake("-n", "measured", succeed=False)
    assert "rig/sweeps.yaml: sweeps.csv, column 'top', row" in refusal and "is empty" in refusal
