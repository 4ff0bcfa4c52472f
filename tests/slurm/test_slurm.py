"""The workflow with profiles/slurm writes the same bytes on a real Slurm as locally."""

import subprocess

import pytest

from tests.slurm import cluster
from tests.workflow.project import keep_dampings, small_project

TARGETS = ["results/resonance.nc", "results/figures/fig2_phase_shift.png"]


@pytest.fixture(scope="module")
def slurm():
    """Return the environment in which commands find the running Slurm cluster."""
    pytest.importorskip("snakemake_executor_plugin_slurm", reason="the extra `slurm` is missing")
    if reason := cluster.missing_requirement():
        pytest.skip(reason)
    with cluster.run_slurm() as environment:
        yield environment


def reduce_to_few_jobs(configuration):
    """Reduce a configuration in place to six jobs, because each job takes seconds on Slurm."""
    keep_dampings(configuration, "k1")
    configuration["resonance"] |= {"directions": ["cold", "up"]}
    configuration["targets"] = ["phase_lag", "resonance"]


def results(project):
    """Return the contents of result files by path, without the provenance, which contains dates."""
    return {
        path: content for path, content in project.results().items() if "provenance" not in path
    }


@pytest.mark.slow
def test_jobs_on_slurm_write_the_same_bytes_as_local_jobs(slurm, tmp_path):
    """Results must not depend on where jobs run, and every job must run on Slurm."""
    local_project, slurm_project = (small_project(tmp_path / name) for name in ("local", "slurm"))
    for project in (local_project, slurm_project):
        project.configure(reduce_to_few_jobs)
    local_project.snakemake("-j2", *TARGETS)
    # The cluster has no accounting. The plugin checks the status of a job again only after ten
    # seconds, so that the first check is delayed by 9 s, when most jobs have finished.
    output = slurm_project.snakemake(
        *TARGETS,
        "--profile=profiles/slurm",
        "--slurm-status-command=squeue",
        "--slurm-no-account",
        "--slurm-init-seconds-before-status-checks=9",
        "--latency-wait=5",
        **slurm,
    )
    job_count = output.count("has been submitted with SLURM jobid")
    # The jobs compile kernels, compute a window and an upward sweep, gather them, compute the phase
    # lag and draw it.
    assert job_count == 6, output
    assert results(slurm_project) == results(local_project)
    assert set(TARGETS) <= set(local_project.results())
    job_states = subprocess.run(
        ["squeue", "--states=all", "--noheader", "--format=%T"],
        env=slurm,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    assert job_states == ["COMPLETED"] * job_count
