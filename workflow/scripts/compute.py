"""Compute the results of a rule: one call, whose arguments are its other params and its inputs."""

import inspect
from pkgutil import resolve_name

from gearlib.data import storage
from inputs import datasets
from joblog import redirect_output


def main(job):
    """Call the function of a job, and store the dataset or the datasets that it returns."""
    redirect_output(job.log[0])
    apart = ("script", "function")
    given = {name: value for name, value in job.params.items() if name not in apart}
    function = resolve_name(job.params.function)
    if "threads" in inspect.signature(function).parameters:
        given["threads"] = job.threads
    found = function(**given, **datasets(job.input))
    for one, path in zip(found if isinstance(found, tuple) else [found], job.output, strict=True):
        storage.write(one, path)


if __name__ == "__main__":
    main(snakemake)
