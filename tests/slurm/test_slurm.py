"""The workflow through profiles/slurm on a real Slurm of one node ends with the same bytes."""

import subprocess

import pytest

from tests.slurm import cluster
from tests.workflow.project import keep_dampings, small_project

TARGETS = ["results/resonance.nc", "results/figures/fig2_phase_shift.png"]


@pytest.fixture(scope="module")
def slurm():
    """Return the environment in which commands find a running Slurm."""
    pytest.importorskip("snakemake_executor_plugin_slurm", reason="the extra `slurm` is missing")
    if reason := cluster.reason_against():
        pytest.skip(reason)
    with cluster.one_node() as environment:
        yield environment


def only_a_few_jobs(settings):
    """Reduce a configuration to few jobs, because each job takes seconds on Slurm."""
    keep_dampings(settings, "k1")
    settings["resonance"] |= {"directions": ["cold", "up"]}
    settings["targets"] = ["phase_lag", "resonance"]


def results(project):
    """Return the contents of result files by path, without the provenance, which has dates."""
    return {path: text for path, text in project.results().items() if "provenance" not in path}


@pytest.mark.slow
def test_jobs_on_slurm_write_the_same_bytes_as_local_jobs(slurm, tmp_path):
    here, there = (small_project(tmp_path / name) for name in ("here", "there"))
    for project in (here, there):
        project.configure(only_a_few_jobs)
    here.snakemake("-j2", *TARGETS)
    # Slurm has no accounting here. The status of a job that still runs is asked for again after ten
    # seconds, so that the first question is delayed by 9 s.
    printed = there.snakemake(
        *TARGETS,
        "--profile=profiles/slurm",
        "--slurm-status-command=squeue",
        "--slurm-no-account",
        "--slurm-init-seconds-before-status-checks=9",
        "--latency-wait=5",
        **slurm,
    )
    jobs = printed.count("has been submitted with SLURM jobid")
    # The jobs are kernels, a window, an upward sweep, gathering, the phase lag and its figure.
    assert jobs == 1 + 2 + 1 + 2, printed
    assert results(there) == results(here)
    assert set(TARGETS) <= set(here.results())
    finished = subprocess.run(
        ["squeue", "--states=all", "--noheader", "--format=%T"],
        env=slurm,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    assert finished == ["COMPLETED"] * jobs
