"""Damaged files, full disks, kill -9: one clear sentence, then the bytes of an undisturbed run."""

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

from tests.workflow.project import SNAKEMAKE, Project, few_jobs, small_project

pytestmark = pytest.mark.slow

#: Number of kills; `make torture` increases it.
KILLS = int(os.environ.get("GEARLIB_KILLS", "3"))

SHARD = "results/phase_planes/k1/0.8200.nc"
OTHER_SHARD = "results/phase_planes/k1m/0.8200.nc"
FIGURE = "results/figures/fig2_phase_shift.png"
FIGURE_SOURCE = "gearlib/figures/phase_shift_figure.py"

#: Appended to a module: the first process that imports it creates a file and waits.
WAIT = """
import pathlib, time

if not pathlib.Path("waits").exists():
    pathlib.Path("waits").touch()
    time.sleep(600)
"""


def tiny_project(folder):
    """Return a project of seven jobs: a phase plane for each of two dampings and the phase lag."""

    def configure(settings):
        """Leave two dampings and two targets."""
        few_jobs(settings, "k1", "k1m")
        settings["figures"]["formats"] = ["png", "pdf"]
        settings["targets"] = ["phase_planes", "phase_lag"]

    project = small_project(folder)
    project.configure(configure)
    return project


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Return a project after an undisturbed run."""
    project = tiny_project(tmp_path_factory.mktemp("robustness") / "built")
    project.snakemake("-j2")
    return project


@pytest.fixture
def project(undisturbed, tmp_path):
    """Return a copy of the project with all its results."""
    shutil.copytree(undisturbed.folder, tmp_path / "project")
    return Project(tmp_path / "project")


@contextmanager
def started(project):
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
            # Background jobs of a shell, and their children, ignore Ctrl-C.
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
    scripts = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            # The fields after the name of the command are state, parent and group.
            group = int(status.read_text().rpartition(")")[2].split()[2])
            command = status.with_name("cmdline").read_bytes()
        except OSError:
            continue
        if group == process.pid and b"/.snakemake/scripts/" in command:
            scripts.append(int(status.parent.name))
    return scripts


def wait_until(condition, process):
    """Wait until a condition holds or the process ends."""
    while not condition() and process.poll() is None:
        time.sleep(0.05)


def replace_result(project):
    """Replace a result by the same result of another configuration."""
    times = os.stat(project / SHARD)
    shutil.copyfile(project / OTHER_SHARD, project / SHARD)
    # The new date is one microsecond earlier, so that it does not look newer to Snakemake.
    os.utime(project / SHARD, ns=(times.st_atime_ns, times.st_mtime_ns - 1000))


#: Damage of results, and the rules whose jobs run after it; None means all rules.
HARM = {
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


@pytest.mark.parametrize("name", HARM)
def test_damaged_results_are_computed_again(project, undisturbed, name):
    harm, rules = HARM[name]
    harm(project)
    assert project.rules("-j2") == rules or rules is None
    assert project.results() == undisturbed.results()
    assert project.rules("-j2") == set()


def test_a_damaged_file_with_its_old_date_is_named_when_read(project):
    times, content = os.stat(project / SHARD), (project / SHARD).read_bytes()
    (project / SHARD).write_bytes(content[: len(content) // 2])
    os.utime(project / SHARD, ns=(times.st_atime_ns, times.st_mtime_ns))
    (project / "results/phase_planes.nc").unlink()
    printed = project.snakemake("-j2", "results/phase_planes.nc", succeed=False)
    assert f"{SHARD} cannot be read as netCDF" in printed and "Traceback" not in printed


@contextmanager
def small_disk(folder, size):
    """Mount a small disk at a folder with the folder's content, and copy it back at the end."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    backup = folder.with_name("backup")
    shutil.copytree(folder, backup)
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder]
    process = subprocess.run(command, capture_output=True, text=True)
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


def test_a_full_disk_is_reported_in_one_sentence(project, undisturbed):
    """A run on a full disk must fail with a sentence, and a run afterwards must succeed."""
    for path in project.results():
        if "phase_planes" in path:
            (project / path).unlink()
    used = sum(path.stat().st_blocks * 512 for path in (project / "results").rglob("*"))
    with small_disk(project / "results", used + 100_000):
        printed = project.snakemake("-j2", succeed=False)
    assert "cannot be written" in printed and "kB are free there" in printed
    assert "Traceback" not in printed
    project.snakemake("-j2")
    assert project.results() == undisturbed.results()


def test_read_only_results_are_reported_in_one_sentence(project):
    for path in (project / "results/figures").glob("fig2_phase_shift.*"):
        path.unlink()
    with small_disk(project / "results", "50m"):
        subprocess.run(["mount", "-o", "remount,ro", project / "results"], check=True)
        printed = project.snakemake("-j2", succeed=False)
    assert "Nothing can be written to results." in printed and "Traceback" not in printed


def test_a_second_workflow_is_refused_and_ctrl_c_ends_the_jobs_of_the_first(project):
    (project / FIGURE).unlink()
    with (project / FIGURE_SOURCE).open("a", encoding="utf-8") as source:
        source.write(WAIT)
    with started(project) as process:
        # When a job runs, the locks are set.
        wait_until((project / "waits").exists, process)
        printed = project.snakemake("-j2", succeed=False)
        assert "cannot be locked" in printed and "Traceback" not in printed
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(60) == 1 and running_jobs(process) == []
    assert "Traceback" not in (project / "printed.txt").read_text(encoding="utf-8")


def test_killed_workflows_lose_no_results(undisturbed, tmp_path):
    """Kill a job, Snakemake alone, whose jobs continue, or everything, and start again."""
    project, dice = tiny_project(tmp_path / "project"), random.Random(20070414)
    for number in range(KILLS):
        with started(project) as process:
            wait_until(functools.partial(running_jobs, process), process)
            time.sleep(dice.uniform(0.0, 3.0))
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
        if number % 3 == 2:
            project.snakemake("-j2")
            assert project.results() == undisturbed.results()
            shutil.rmtree(project / "results")
            shutil.rmtree(project / ".snakemake")
