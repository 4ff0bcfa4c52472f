"""Draw the analytic method and harmonic balance, in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import analytic_method, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    data = storage.read(snakemake.input.dataset)
    for figure, paths in (
        (analytic_method.draw_convergence(data), snakemake.output.convergence),
        (analytic_method.draw_harmonics(data), snakemake.output.harmonics),
    ):
        figure.set_dpi(snakemake.params.dpi)
        # One format is a path, several are a list.
        for path in [paths] if isinstance(paths, str) else paths:
            style.save(figure, path)
