"""Compute: one job for each window of a sweep, one for each phase plane."""


# Without this rule the first jobs would each compile the kernels of a gear pair. Its stamp is an
# ordinary input: behind an "ancient" one Snakemake would overlook edits of sources that both rules
# share.
use rule job as compile_kernels with:
    pathvars:
        job="compile_kernels",
    input:
        sources=script_sources("compile_kernels"),
    output:
        stamp="results/kernels.sha256",
    params:
        script="compile_kernels",


# Those of larger models, beside the others. Jobs that need most of them wait.
use rule job as compile_larger_kernels with:
    pathvars:
        job="compile_larger_kernels",
    input:
        sources=script_sources("compile_larger_kernels"),
    output:
        stamp="results/larger_kernels.sha256",
    params:
        script="compile_larger_kernels",


use rule job as compile_train_kernels with:
    pathvars:
        job="compile_train_kernels",
    input:
        sources=script_sources("compile_train_kernels"),
    output:
        stamp="results/train_kernels.sha256",
    params:
        script="compile_train_kernels",


use rule job as sweep_window with:
    pathvars:
        job="resonance/{damping}/{direction}/{window}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("sweep_window"),
    output:
        window="results/resonance/{damping}/{direction}/{window}.nc",
    params:
        script="sweep_window",
        pair=pair_of,
        step=CONFIG.resonance.step,
        run=canonical(run_length()),


use rule job as phase_plane with:
    pathvars:
        job="phase_planes/{damping}/{tuning}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("phase_plane"),
    output:
        plane="results/phase_planes/{damping}/{tuning}.nc",
    params:
        script="phase_plane",
        pair=pair_of,
        run=canonical(run_length() | {"samples_per_period": CONFIG.run.samples_per_period}),
