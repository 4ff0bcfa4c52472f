"""The workflow draws and scores measured data, and refuses damaged data before any job starts."""

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


def test_measured_data_are_scored_rerun_their_jobs_and_are_refused_if_damaged(project):
    """Computed sweeps that serve as measured data must fit the model that computed them."""
    curves = xr.load_dataset(project / "results/resonance.nc").sel(damping="k1")
    micrometres_per_deflection = 1e6 * float(curves.static_deflection)
    peaks = curves.displacement_max * micrometres_per_deflection
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
    assert project.run_rules("-j2", "measured", "resonance") == rules
    with open(project / "results/measured.csv", newline="") as file:
        scores = {(row["damping"], row["quantity"]): row for row in csv.DictReader(file)}
    # The data were computed with the damping k1, so that only its misfit vanishes up to rounding.
    misfit = "misfit of displacement_max over its range, free gain and offset"
    assert float(scores["k1", misfit]["computed"]) < 1e-6 < float(scores["k1m", misfit]["computed"])
    assert misfit in (project / "results/tables/measured.html").read_text()
    # A further row changes the data.
    table.write_text(table.read_text() + f"{float(curves.speed[-1]) - 1.0},up,11\n")
    assert project.planned_rules("measured", "resonance") == rules
    # A row with NaN must be refused even by a dry run.
    table.write_text(table.read_text() + "3000,up,nan\n")
    refusal = project.snakemake("-n", "measured", succeed=False)
    assert "rig/sweeps.yaml: sweeps.csv, column 'peak', row" in refusal and "is empty" in refusal
