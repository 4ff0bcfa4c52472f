"""Measured sets in the workflow: drawn, scored, and refused before any job starts."""

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
        "rpm": {"observableId": "speed", "unit": "rpm"},
        "sweep": {"observableId": "direction", "unit": 1},
        "peak": {"observableId": "displacement_max", "unit": "um", "noise": 0.1},
    },
}


def test_measured_data_rerun_their_jobs_and_damaged_data_stop_every_job(project):
    """Use computed sweeps as measured data, then change them and damage them."""
    curves = xr.load_dataset(project / "results/resonance.nc").sel(damping="k1")
    peaks = curves.displacement_max * float(curves.static_deflection) * 1e6
    rows = [
        f"{speed},{direction},{peak}\n"
        for direction in ("up", "down")
        for speed, peak in zip(
            curves.speed.values, peaks.sel(direction=direction).values, strict=True
        )
    ]
    (project / "rig").mkdir()
    (project / "rig/sweeps.yaml").write_text(yaml.safe_dump(SWEEPS))
    table = project / "rig/sweeps.csv"
    table.write_text("rpm,sweep,peak\n" + "".join(rows))
    project.configure(lambda settings: settings.update(measured=["rig/sweeps.yaml"]))
    rules = {"measured_curve", "measured_table", "draw_resonance", "measured", "resonance"}
    assert project.rules("-j2", "measured", "resonance") == rules
    with open(project / "results/measured.csv", newline="") as file:
        scores = {(row["damping"], row["quantity"]): row for row in csv.DictReader(file)}
    # The data are computed with the damping k1, so that its misfit vanishes, but not that of k1m.
    misfit = "misfit of displacement_max over its range, free gain and offset"
    assert float(scores["k1", misfit]["computed"]) < 1e-6 < float(scores["k1m", misfit]["computed"])
    assert misfit in (project / "results/tables/measured.html").read_text()
    table.write_text(table.read_text() + f"{float(curves.speed[-1]) - 1.0},up,11\n")
    assert project.planned("measured", "resonance") == rules
    # A row without a number is refused before any job starts.
    table.write_text(table.read_text() + "3000,up,nan\n")
    refusal = project.snakemake("-n", "measured", succeed=False)
    assert "rig/sweeps.yaml: sweeps.csv, column 'peak', row" in refusal and "is empty" in refusal
