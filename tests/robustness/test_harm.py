"""After damaged files, full disks and killed processes a new run must restore all results."""

import functools
import os
import random
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.workflow.project import SNAKEMAKE, Project, keep_dampings, small_project

pytestmark = pytest.mark.slow

#: Number of workflows that are killed; `make torture` increases it.
KILL_COUNT = int(os.environ.get("GEARLIB_KILLS", "3"))

SHARD = "results/phase_planes/k1/0.8200.nc"
OTHER_SHARD = "results/phase_planes/k1m/0.8200.nc"
FIGURE = "results/figures/fig2_phase_shift.png"
FIGURE_SOURCE = "gearlib/figures/phase_shift_figure.py"

#: Code for a module: the first process that imports it creates the file "waits" and waits.
WAITING_CODE = """
import pathlib, time

if not pathlib.Path("waits").exists():
    pathlib.Path("waits").touch()
    time.sleep(600)
"""


def tiny_project(folder):
    """Return a project that computes the phase lag and phase planes of two dampings."""

    def configure(settings):
        """Keep two dampings and two targets."""
        keep_dampings(settings, "k1", "k1m")
        settings["figures"]["formats"] = ["png", "pdf"]
        settings["targets"] = ["phase_planes", "phase_lag"]

    project = small_project(folder)
    project.configure(configure)
    return project


@pytest.fixture(scope="module")
def undisturbed_project(tmp_path_factory):
    """Return a project after an undisturbed_project run."""
    project = tiny_project(tmp_path_factory.mktemp("robustness") / "built")
    project.snakemake("-j2")
    return project


@pytest.fixture
def project(undisturbed_project, tmp_path):
    """Return a copy of the project with all its results."""
    shutil.copytree(undisturbed_project.folder, tmp_path / "project")
    return Project(tmp_path / "project")


@contextmanager
def start_workflow(project):
    """Start a workflow, yield its process, and kill all remaining jobs at the end.

    The output goes to a file, because jobs that outlive Snakemake would keep a pipe open.
    """
    with (project / "printed.txt").open("w", encoding="utf-8") as printed:
        process = subprocess.Popen(
            [SNAKEMAKE, "-j2"],
            cwd=project.folder,
            stdout=printed,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            # If a shell runs the tests in the background, Ctrl-C would be ignored otherwise.
            preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        )
    try:
        yield process
    finally:
        if process.poll() is None or running_jobs(process):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def running_jobs(process):
    """Return the process ids of the running job scripts of a workflow."""
    process_ids = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            # The fields after the name of the command are state, parent and process group.
            group = int(status.read_text().rpartition(")")[2].split()[2])
            command = status.with_name("cmdline").read_bytes()
        except OSError:
            continue
        if group == process.pid and b"/.snakemake/scripts/" in command:
            process_ids.append(int(status.parent.name))
    return process_ids


def wait_until(condition, process):
    """Wait until a condition holds or the process ends."""
    while not condition() and process.poll() is None:
        time.sleep(0.05)


def replace_result(project):
    """Replace a result by that of another damping without making it look newer."""
    times = os.stat(project / SHARD)
    shutil.copyfile(project / OTHER_SHARD, project / SHARD)
    # Snakemake must not recognize the change by a newer date.
    os.utime(project / SHARD, ns=(times.st_atime_ns, times.st_mtime_ns - 1000))


#: Functions that damage results, and the rules whose jobs must run then; None means any rules.
DAMAGES = {
    "a result of another configuration": (
        replace_result,
        {"phase_plane", "gather_phase_planes", "draw_phase_planes"},
    ),
    "an edited picture": (
        lambda project: (project / FIGURE).write_bytes(b"not PNG\n"),
        {"draw_phase_lag"},
    ),
    "results without records": (lambda project: shutil.rmtree(project / ".snakemake"), None),
}


@pytest.mark.release
@pytest.mark.parametrize("name", DAMAGES)
def test_damaged_results_are_computed_again(project, undisturbed_project, name):
    """A run after a damage must restore the results, and a further run must find nothing to do."""
    damage, expected_rules = DAMAGES[name]
    damage(project)
    rules = project.run_rules("-j2")
    assert rules == expected_rules or expected_rules is None
    assert project.results() == undisturbed_project.results()
    assert project.run_rules("-j2") == set()


def test_an_unreadable_result_is_reported_by_its_name(project):
    """Half a netCDF file with its old date must be reported by its path when a job reads it."""
    times, content = os.stat(project / SHARD), (project / SHARD).read_bytes()
    (project / SHARD).write_bytes(content[: len(content) // 2])
    os.utime(project / SHARD, ns=(times.st_atime_ns, times.st_mtime_ns))
    (project / "results/phase_planes.nc").unlink()
    printed = project.snakemake("-j2", "results/phase_planes.nc", succeed=False)
    assert f"{SHARD} cannot be read as netCDF" in printed and "Traceback" not in printed


@contextmanager
def mount_small_disk(folder, size):
    """Move the content of a folder to a small disk that is mounted there, and back at the end."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    backup = folder.with_name("backup")
    shutil.copytree(folder, backup)
    mount_command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder]
    process = subprocess.run(mount_command, capture_output=True, text=True)
    if process.returncode:
        pytest.skip(f"no disk could be mounted: {process.stderr.strip()}")
    try:
        shutil.copytree(backup, folder, dirs_exist_ok=True)
        yield
        shutil.rmtree(backup)
        shutil.copytree(folder, backup)
    finally:
        subprocess.run(["umount", folder], check=True)
        shutil.rmtree(folder)
        backup.rename(folder)


@pytest.mark.release
def test_a_full_disk_is_reported_in_one_sentence(project, undisturbed_project):
    """A run on a full disk must fail with one sentence, and a run with more space must succeed."""
    for path in project.results():
        if "phase_planes" in path:
            (project / path).unlink()
    block_size, free_size = 512, 100_000  # bytes; the results need more than 100 kB
    paths = (project / "results").rglob("*")
    used_size = sum(path.stat().st_blocks * block_size for path in paths)
    with mount_small_disk(project / "results", used_size + free_size):
        printed = project.snakemake("-j2", succeed=False)
    assert "cannot be written" in printed and "kB are free there" in printed
    assert "Traceback" not in printed
    project.snakemake("-j2")
    assert project.results() == undisturbed_project.results()


def test_a_read_only_results_folder_is_reported_in_one_sentence(project):
    """The message must name the folder, because no job can write to it."""
    for path in (project / "results/figures").glob("fig2_phase_shift.*"):
        path.unlink()
    with mount_small_disk(project / "results", "50m"):
        subprocess.run(["mount", "-o", "remount,ro", project / "results"], check=True)
        printed = project.snakemake("-j2", succeed=False)
    assert "Nothing can be written to results." in printed and "Traceback" not in printed


def test_a_second_workflow_is_refused_and_ctrl_c_ends_the_first(project):
    """A second workflow must not disturb the first; Ctrl-C must end the first with its jobs."""
    (project / FIGURE).unlink()
    with (project / FIGURE_SOURCE).open("a", encoding="utf-8") as source:
        source.write(WAITING_CODE)
    with start_workflow(project) as process:
        # A running job means that the first workflow has locked the folder.
        wait_until((project / "waits").exists, process)
        printed = project.snakemake("-j2", succeed=False)
        assert "cannot be locked" in printed and "Traceback" not in printed
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(60) == 1 and running_jobs(process) == []
    assert "Traceback" not in (project / "printed.txt").read_text(encoding="utf-8")


@pytest.mark.release
def test_killed_workflows_lose_no_results(undisturbed_project, tmp_path):
    """After a job, Snakemake or all processes were killed, a run must give the undisturbed results.

    Jobs continue if only Snakemake is killed.
    """
    project, rng = tiny_project(tmp_path / "project"), random.Random(20070414)
    for number in range(KILL_COUNT):
        with start_workflow(project) as process:
            wait_until(functools.partial(running_jobs, process), process)
            time.sleep(rng.uniform(0.0, 3.0))
            victim = ("job", "snakemake", "everything")[number % 3]
            with suppress(IndexError, ProcessLookupError):
                if victim == "job":
                    os.kill(running_jobs(process)[0], signal.SIGKILL)
                    process.wait(300)
                elif victim == "snakemake":
                    process.kill()
                else:
                    os.killpg(process.pid, signal.SIGKILL)
        project.snakemake("--unlock")
        # Every third time the workflow is completed and then starts from nothing.
        if number % 3 == 2:
            project.snakemake("-j2")
            assert project.results() == undisturbed_project.results()
            shutil.rmtree(project / "results")
            shutil.rmtree(project / ".snakemake")
