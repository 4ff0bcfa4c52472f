"""Damaged files, refusing disks, kill -9: one clear sentence, then the bytes of an undisturbed run.

One file, so that one worker makes the undisturbed run, once.
"""

import os
import shutil
import signal
import subprocess
from contextlib import contextmanager

import pytest

from tests.robustness.disturbed import data, disturb, end, jobs_of, start, tiny_project, wait

pytestmark = pytest.mark.slow

# `make torture` asks for more.
KILLS = int(os.environ.get("GEARLIB_KILLS", "3"))

SHARD = "results/phase_planes/k1/0.8200.nc"
FOREIGN = "results/phase_planes/k1m/0.8200.nc"
FIGURE = "results/figures/fig2_phase_shift.png"

#: Of a module: whoever imports it first says so and waits for a file.
UNTIL_TOLD = """
import pathlib, time

if not pathlib.Path("waits").exists():
    pathlib.Path("waits").touch()
    while not pathlib.Path("go").exists():
        time.sleep(0.05)
"""


def cut(project):
    whole = (project / SHARD).read_bytes()
    return whole[: len(whole) // 2]


REFUSED = "Not what their jobs wrote"


def replace(project, path, content):
    """Put another content into a result, by its time neither new nor old."""
    times = os.stat(project / path)
    (project / path).write_bytes(content)
    # It would be up to date for whoever compares times.
    os.utime(project / path, ns=(times.st_atime_ns, times.st_mtime_ns + 1000))


def test_a_replaced_result_is_named(project):
    replace(project, SHARD, (project / FOREIGN).read_bytes())
    printed = project.snakemake("-j2", succeed=False)
    (sentence,) = (line for line in printed.splitlines() if SHARD in line)
    assert sentence.startswith(f"{REFUSED}: {SHARD}. To have them computed anew,")
    assert "Traceback" not in printed
    # Who only asks is answered.
    for question in ("-n", "--dag", "--unlock"):
        assert f"{REFUSED}: {SHARD}" in project.snakemake(question)
    (project / SHARD).unlink()
    assert project.planned(SHARD) == {"phase_plane": 1}


def test_a_picture_changed_by_hand_stays(project):
    replace(project, FIGURE, b"not PNG\n")
    assert project.jobs("-j2") == {}
    assert (project / FIGURE).read_bytes() == b"not PNG\n"
    # Until its data change.
    project.configure(lambda settings: settings["phase_lag"].update(periods=110))
    assert project.planned()["draw_phase_lag"] == 1


def test_results_from_another_folder_are_named(project):
    shutil.rmtree(project / ".snakemake")
    printed = project.snakemake("-j2", succeed=False)
    (sentence,) = (line for line in printed.splitlines() if "No record says how" in line)
    assert "come from another folder, or .snakemake was removed" in sentence
    assert "Traceback" not in printed
    assert "No record says how" in project.snakemake("-n")
    shutil.rmtree(project / "results")
    assert project.planned()


def test_a_touched_result_is_still_the_same(project):
    for path in data(project):
        os.utime(project / path)
    # Newer than what was made of them, but equal to what their jobs wrote.
    assert project.planned() == {}


def test_a_damaged_file_without_checksum_is_named_when_read(project):
    (project / SHARD).write_bytes(cut(project))
    (project / "results/logs/phase_planes/k1/0.8200.log").unlink()
    printed = project.snakemake("-j2", succeed=False)
    assert f"{SHARD} cannot be read as netCDF" in printed and "Traceback" not in printed


@contextmanager
def small_disk(folder, size):
    """A disk of its own for a folder, with what is in it."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    kept = folder.with_name("kept")
    folder.rename(kept)
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no disk could be mounted: {done.stderr.strip()}")
    try:
        shutil.copytree(kept, folder, dirs_exist_ok=True)
        yield
        shutil.rmtree(kept)
        shutil.copytree(folder, kept)
    finally:
        subprocess.run(["umount", folder], check=True)
        folder.rmdir()
        kept.rename(folder)


def test_a_full_disk(project, undisturbed):
    for path in data(project):
        if "phase_planes" in path:
            (project / path).unlink()
    used = sum(path.stat().st_blocks * 512 for path in (project / "results").rglob("*"))
    with small_disk(project / "results", used + 100_000):
        printed = project.snakemake("-j2", succeed=False)
    assert "cannot be written" in printed and "kB are free there" in printed
    assert "Traceback" not in printed
    project.snakemake("-j2")
    assert data(project) == undisturbed.data


def test_results_that_may_not_be_written(project, undisturbed):
    for path in (project / "results/figures").glob("fig2_phase_shift.*"):
        path.unlink()
    with small_disk(project / "results", "50m"):
        remount = ["mount", "-o", "remount,ro", project / "results"]
        subprocess.run(remount, check=True)
        printed = project.snakemake("-j2", succeed=False)
    assert "Nothing can be written to results." in printed and "Traceback" not in printed
    project.snakemake("-j2")
    assert data(project) == undisturbed.data


def test_two_at_once(project, undisturbed):
    (project / FIGURE).unlink()
    with (project / "gearlib/figures/phase_shift_figure.py").open("a", encoding="utf-8") as source:
        source.write(UNTIL_TOLD)
    process = start(project)
    try:
        # A job runs, so the locks are written, and stay until it may go on.
        while not (project / "waits").exists():
            assert not wait(process, 0.05)
        printed = project.snakemake("-j2", succeed=False)
        (project / "go").touch()
        assert wait(process, 300)
    finally:
        end(process)
    assert "cannot be locked" in printed and "Traceback" not in printed
    assert process.returncode == 0
    assert data(project) == undisturbed.data


def test_ctrl_c_ends_the_jobs_without_a_word_of_python(project, undisturbed):
    (project / FIGURE).unlink()
    source = project / "gearlib/figures/phase_shift_figure.py"
    drawn = source.read_text(encoding="utf-8")
    source.write_text(drawn + UNTIL_TOLD, encoding="utf-8")
    process = start(project)
    try:
        while not (project / "waits").exists():
            assert not wait(process, 0.05)
        os.killpg(process.pid, signal.SIGINT)
        assert wait(process, 60) and jobs_of(process) == []
    finally:
        end(process)
    assert process.returncode == 1
    assert "Traceback" not in (project / "printed.txt").read_text(encoding="utf-8")
    source.write_text(drawn, encoding="utf-8")
    project.snakemake("-j2")
    assert data(project) == undisturbed.data


def test_what_killed_processes_left_is_removed(project, undisturbed):
    left = project / "results/figures/.12345.fig2_phase_shift.png"
    left.write_bytes(b"half a figure")
    (project / FIGURE).unlink()
    project.snakemake("-j2")
    assert data(project) == undisturbed.data


def test_nothing_is_lost_by_kills(undisturbed, tmp_path, capsys):
    def check(project):
        found = data(project)
        assert found.keys() == undisturbed.data.keys()
        assert [path for path in found if found[path] != undisturbed.data[path]] == []

    happened = disturb(
        tiny_project(tmp_path / "project"),
        KILLS,
        # The later part of a run is reached by what earlier, killed runs have left.
        duration=undisturbed.seconds / 3,
        seed=20070414,
        check=check,
    )
    with capsys.disabled():
        print(f"\n{KILLS} kills:", dict(happened))
