"""The workflow from the shell: of an installed package too, which holds its rules."""

import os
import shutil
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import click

from gearlib.cli import output
from gearlib.config import yaml_keys

#: Where a wheel has the files of the workflow, and where they lie in a checkout.
_INSTALLED = Path(__file__).parents[1] / "installed_workflow"
_CHECKOUT = Path(__file__).parents[2]

_jobs = click.option(
    "-j",
    "--jobs",
    type=click.IntRange(1),
    default=min(2, os.cpu_count() or 1),
    show_default=True,
    help="Processes at a time.",
)


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path), default="paper")
@_jobs
@click.option("--all", "everything", is_flag=True, help="Every target, not the paper's alone.")
def paper(folder, jobs, everything):
    """Reproduce the paper in FOLDER, by default ./paper: figures, and a table of its statements.

    FOLDER gets results/ and the config.yaml that is used; one that is there stays.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "config.yaml").exists():
            shutil.copyfile(files() / "config.yaml", folder / "config.yaml")
    except OSError as error:
        output.fail(f"{folder} cannot be made: {error.strerror}")
    _run(folder, [f"-j{jobs}", "all" if everything else "paper"])


@click.command(context_settings={"ignore_unknown_options": True, "help_option_names": ["-h"]})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def workflow(arguments):
    """Run the workflow here: snakemake with the rules of this package.

    ARGUMENTS are those of snakemake, as in `gearlib workflow -j2 --configfile mine.yaml`; --config
    mine.yaml is the same, as in all other commands.
    """
    _run(Path(), list(_checked(arguments)) or ["-j2"])


def _checked(arguments):
    """Yield the arguments; refuse files that Snakemake would read without naming their faults."""
    given = False
    for argument, following in zip(arguments, (*arguments[1:], ""), strict=True):
        option, equal, value = argument.partition("=")
        # Snakemake's own --config takes pairs KEY=VALUE.
        if option == "--config" and "=" not in (value or following):
            option = "--configfile"
            argument = option + equal + value
        named = option in ("--configfile", "--configfiles")
        path = value if named else argument
        given = named or given and not argument.startswith("-")
        if given and path:
            if not Path(path).is_file():
                raise click.UsageError(
                    f"--configfile {path} is not allowed: it must be a file; targets come before "
                    "the option"
                )
            yaml_keys.read(path)
        yield argument


def files():
    """Return the folder of the Snakefile, the configuration and the rules."""
    return _INSTALLED if _INSTALLED.is_dir() else _CHECKOUT


def _run(folder, arguments):
    """Call Snakemake in a folder, and end as it ends."""
    if find_spec("snakemake") is None:
        output.fail("snakemake is missing: install gearlib[workflow]")
    root = files()
    profile = root / "profiles/default"
    command = [sys.executable, "-m", "snakemake", "--snakefile", root / "Snakefile"]
    command += ["--workflow-profile", profile, "--directory", folder]
    # The profile names it from the folder of the rules.
    command += ["--report-stylesheet", root / "workflow/report/report.css", *arguments]
    process = subprocess.Popen(command)
    # Ctrl-C is for Snakemake, which ends its jobs first.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(process.wait())
