"""Run a temporary Slurm cluster whose only node is this machine.

munged, slurmctld and slurmd are the installed programs. Their sockets, keys, states and ports are
separate from those of a cluster that may already run, and are removed at the end.
"""

import os
import shutil
import socket
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "setpriv")

CONFIGURATION = """\
ClusterName=gearlib
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MinJobAge=36000
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def missing_requirement():
    """Return a sentence on what Slurm needs to start on this machine, or None if it can start."""
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
    missing = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    if missing:
        return f"not installed: {', '.join(missing)}; `make slurm-test` installs them on Debian"
    if os.geteuid() != 0:
        return "only root can start Slurm"
    return None


@contextmanager
def run_slurm():
    """Start Slurm on this machine, yield the environment of its commands, and stop it."""
    folder = Path(tempfile.mkdtemp(prefix="slurm-"))
    environment = {
        **os.environ,
        "SLURM_CONF": str(folder / "slurm.conf"),
        "PATH": os.pathsep.join([str(folder / "bin"), os.environ["PATH"], "/usr/sbin", "/sbin"]),
    }
    daemons = []
    try:
        _write_slurm_folder(folder)
        munge = folder / "munge"
        files = [f"--{key}={munge / name}" for key, name in _MUNGE_FILES.items()]
        for command in (
            ["munged", "--foreground", "--num-threads=4", *files],
            ["slurmctld", "-D"],
            ["slurmd", "-D"],
        ):
            daemons.append(_start_daemon(command, environment, folder))
            if command[0] == "munged":
                _wait_until(lambda: (munge / "socket").exists(), folder)
        _wait_until(
            lambda: "idle" in _run_command(["sinfo", "-h", "-o", "%T"], environment), folder
        )
        yield environment
        _run_command(["scancel", "--user=root", "--full"], environment)
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
            daemon.wait(timeout=300)
        shutil.rmtree(folder)


_MUNGE_FILES = {
    "key-file": "key",
    "socket": "socket",
    "pid-file": "munged.pid",
    "log-file": "munged.log",
    "seed-file": "seed",
}


def _write_slurm_folder(folder):
    """Write the Slurm configuration, the secret key of munged and a wrapper script for srun."""
    # munged requires a socket that every user can reach and a key that no other user can read.
    folder.chmod(0o755)
    for name in ("munge", "state", "spool", "bin"):
        (folder / name).mkdir(mode=0o755)
    key = folder / "munge" / "key"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(1024))
    text = CONFIGURATION.format(
        folder=folder,
        host=socket.gethostname().split(".")[0],
        ports=_free_ports(2),
        cpus=os.cpu_count(),
        memory=2100 * os.cpu_count(),  # MB; the profile requests 2000 MB per job
    )
    (folder / "slurm.conf").write_text(text, encoding="utf-8")
    # Inside a job, the executor plugin removes all variables SLURM_*, including SLURM_CONF, before
    # it calls srun, so that a wrapper sets it again.
    srun = folder / "bin" / "srun"
    real = shutil.which("srun", path=os.environ["PATH"])
    srun.write_text(f'#!/bin/sh\nSLURM_CONF={folder}/slurm.conf exec {real} "$@"\n')
    srun.chmod(0o755)


def _free_ports(count):
    """Return the numbers of `count` free TCP ports."""
    sockets = [socket.socket() for _ in range(count)]
    for port_socket in sockets:
        port_socket.bind(("127.0.0.1", 0))  # the system chooses a free port
    ports = [port_socket.getsockname()[1] for port_socket in sockets]
    for port_socket in sockets:
        port_socket.close()
    return ports


def _start_daemon(command, environment, folder):
    """Start a daemon that ends with this process, and write its output to a file."""
    log_path = folder / f"{command[0]}.out"
    # The kernel terminates the daemon even if this process is killed.
    command = ["setpriv", "--pdeathsig=TERM", *command]
    with open(log_path, "wb") as log:
        return subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )


def _run_command(command, environment):
    """Run a command and return its output."""
    options = {"env": environment, "capture_output": True, "text": True, "timeout": 300}
    return subprocess.run(command, **options).stdout


def _wait_until(is_ready, folder, seconds=300):
    """Wait until `is_ready()` is true, or raise an error with the logs of the daemons."""
    deadline = time.monotonic() + seconds
    while not is_ready():
        if time.monotonic() > deadline:
            paths = sorted([*folder.glob("*.log"), *folder.glob("*.out")])
            logs = "\n".join(path.read_text() for path in paths)
            raise RuntimeError(f"Slurm did not start within {seconds} s\n{logs}")
        time.sleep(0.2)
