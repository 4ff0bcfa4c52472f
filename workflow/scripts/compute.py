"""Compute the dataset of a rule: one call, whose arguments are its other params and its inputs."""

from pkgutil import resolve_name

from joblog import redirect_output
from gearlib.data import storage
from inputs import datasets

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    apart = ("script", "function")
    given = {name: value for name, value in snakemake.params.items() if name not in apart}
    function = resolve_name(snakemake.params.function)
    storage.write(function(**given, **datasets(snakemake.input)), snakemake.output.dataset)
