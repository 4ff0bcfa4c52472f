"""A very small project, and how to kill what runs in it."""

import contextlib
import functools
import os
import random
import shutil
import signal
import subprocess
from collections import Counter
from pathlib import Path

from tests.workflow.forked import SNAKEMAKE
from tests.workflow.project import small_project

VICTIMS = ("snakemake", "job", "everything")


def tiny_project(folder):
    """Return a project of seven jobs: a phase plane for each of two dampings, the phase lag."""

    def leave(settings):
        for named in (settings["dampings"], settings["figures"]["colours"]):
            for name in named.keys() - {"k1", "k1m"}:
                del named[name]
        settings["figures"]["formats"] = ["png", "pdf"]
        settings["stability_chart"] = {"damping": "k1"}
        settings["scenes"] = {}
        settings["targets"] = ["phase_planes", "phase_lag"]

    project = small_project(folder)
    project.configure(leave)
    return project


def data(project):
    """Return the result files by their paths, without what tells the time."""
    found = project.results()
    found.pop("results/provenance.json", None)
    return found


def start(project):
    """Start the workflow; its process leads a group of its own, jobs included."""
    # Not a pipe: jobs that outlive Snakemake would keep it open.
    with (project / "printed.txt").open("w", encoding="utf-8") as printed:
        return subprocess.Popen(
            [SNAKEMAKE, "-j2"],
            cwd=project.folder,
            stdout=printed,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            # A shell's background jobs, and what they start, ignore Ctrl-C.
            preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        )


def wait(process, seconds):
    """Wait for the end of a process; return whether it came in time."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def jobs_of(process):
    """Return the process ids of the running scripts of a workflow."""
    scripts = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
            command = status.with_name("cmdline").read_bytes()
        except OSError:
            continue
        # Fields after the name: state, parent, group.
        if int(fields[2]) == process.pid and b"/.snakemake/scripts/" in command:
            scripts.append(int(status.parent.name))
    return sorted(scripts)


def kill(process, victim, dice):
    """Kill -9 one job, Snakemake alone (its jobs go on), or everything; return what was killed."""
    if victim == "job":
        # None runs yet, or the one that did has just come to its end.
        with contextlib.suppress(IndexError, ProcessLookupError):
            os.kill(dice.choice(jobs_of(process)), signal.SIGKILL)
            return "job"
        victim = "everything"
    if victim == "snakemake":
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)
    return victim


def end(process):
    """Kill what is left of a workflow, jobs that outlived Snakemake included."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def disturb(project, count, duration, seed, check):
    """Kill a workflow again and again, and start it anew.

    Parameters
    ----------
    project : Project
    count : int
        Number of kills.
    duration : float
        Seconds from a start to the latest kill.
    seed : int
        Of the moments and of the choice among the running jobs.
    check : callable
        Called with the project whenever it has come to its end; then it starts from nothing.

    Returns
    -------
    collections.Counter
        What happened, how often: what was killed; "locked", "finished".
    """
    dice, happened, started = random.Random(seed), Counter(), []
    try:
        while (kills := sum(happened[victim] for victim in VICTIMS)) < count:
            started.append(start(project))
            if not wait(started[-1], dice.uniform(0.0, duration)):
                happened[kill(started[-1], VICTIMS[kills % 3], dice)] += 1
                # After the kill of a job Snakemake stops by itself, when the others have ended.
                assert wait(started[-1], 300)
            else:
                _go_on(project, started, happened, check)
        finished = happened["finished"]
        while happened["finished"] == finished:
            started.append(start(project))
            assert wait(started[-1], 300)
            _go_on(project, started, happened, check)
    finally:
        for process in started:
            end(process)
    return happened


def _go_on(project, started, happened, check):
    """Go on after a run that has come to its end: unlocked, or checked and from nothing."""
    if started[-1].returncode:
        printed = (project / "printed.txt").read_text(encoding="utf-8")
        assert "--unlock" in printed, printed
        project.snakemake("--unlock")
        happened["locked"] += 1
        return
    for process in started:
        end(process)
    started.clear()
    check(project)
    happened["finished"] += 1
    shutil.rmtree(project / "results")
    shutil.rmtree(project / ".snakemake")
