"""Call the function of a rule with its params and input datasets, and store the results."""

import inspect
from pkgutil import resolve_name

from gearlib.data import storage
from gearlib.models.from_values import build_models
from job import read_datasets, redirect_output


def main(job):
    """Call the function of a Snakemake job and write the datasets it returns to its outputs."""
    redirect_output(job.log[0])
    excluded = ("script", "function")
    params = {name: value for name, value in job.params.items() if name not in excluded}
    arguments = {name: build_models(value) for name, value in params.items()}
    function = resolve_name(job.params.function)
    if "threads" in inspect.signature(function).parameters:
        arguments["threads"] = job.threads
    results = function(**arguments, **read_datasets(job.input))
    if not isinstance(results, tuple):
        results = (results,)
    for dataset, path in zip(results, job.output, strict=True):
        storage.write(dataset, path)


if __name__ == "__main__":
    main(snakemake)
