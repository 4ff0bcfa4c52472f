"""A Slurm of one node, this machine, in a folder of its own: started, used, gone without a trace.

munged, slurmctld and slurmd are the real programs of the distribution, with their sockets, keys,
states and ports apart from those of a Slurm that may be installed.
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


def reason_against():
    """Return the reason why Slurm cannot be started here, or None if it can."""
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
    missing = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    if missing:
        return f"not installed: {', '.join(missing)}; `make slurm-test` installs them on Debian"
    if os.geteuid() != 0:
        return "only root can start a Slurm"
    return None


@contextmanager
def one_node():
    """Start Slurm on this machine, yield the environment for its commands, and stop it."""
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
            daemons.append(_start(command, environment, folder))
            if command[0] == "munged":
                _wait(lambda: (munge / "socket").exists(), folder)
        _wait(lambda: "idle" in _output(["sinfo", "-h", "-o", "%T"], environment), folder)
        yield environment
        _output(["scancel", "--user=root", "--full"], environment)
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
    """Write the configuration, the key of munged and a wrapper of srun into a folder."""
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
        memory=2100 * os.cpu_count(),  # MB, of which the profile asks 2000 for a job
    )
    (folder / "slurm.conf").write_text(text, encoding="utf-8")
    # Inside a job the executor plugin removes all variables SLURM_*, including the path of the
    # configuration, before it calls srun.
    srun = folder / "bin" / "srun"
    real = shutil.which("srun", path=os.environ["PATH"])
    srun.write_text(f'#!/bin/sh\nSLURM_CONF={folder}/slurm.conf exec {real} "$@"\n')
    srun.chmod(0o755)


def _free_ports(count):
    """Return numbers of free ports."""
    sockets = [socket.socket() for _ in range(count)]
    for unbound in sockets:
        unbound.bind(("127.0.0.1", 0))
    ports = [bound.getsockname()[1] for bound in sockets]
    for bound in sockets:
        bound.close()
    return ports


def _start(command, environment, folder):
    """Start a daemon that ends with this process."""
    # The kernel sends the signal however this process ends.
    command = ["setpriv", "--pdeathsig=TERM", *command]
    with open(folder / f"{command[2]}.out", "wb") as log:
        return subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )


def _output(command, environment):
    """Return the output of a command."""
    options = {"env": environment, "capture_output": True, "text": True, "timeout": 300}
    return subprocess.run(command, **options).stdout


def _wait(ready, folder, seconds=300):
    """Wait until `ready()` is true, or raise an error with the logs of the daemons."""
    end = time.monotonic() + seconds
    while not ready():
        if time.monotonic() > end:
            paths = sorted([*folder.glob("*.log"), *folder.glob("*.out")])
            logs = "\n".join(path.read_text() for path in paths)
            raise RuntimeError(f"Slurm did not come up within {seconds} s\n{logs}")
        time.sleep(0.2)
