"""The rules of all studies, made from their records in `gearlib.config.studies`."""


def path_of(function):
    """Return the full name of a function of a study: gearlib.studies where it names no other."""
    return function if function.startswith("gearlib.") else f"gearlib.studies.{function}"


def sources_of(job):
    """Return the sources of a job, or a function of the wildcards that name its methods."""
    loaded, methods = [path_of(job.function).split(":")[0]], job.methods(CONFIG)
    if callable(methods):
        # All of them now: what is written later is not there for Snakemake, which looks once.
        lists = {
            name: script_sources(job.script, name, loaded=loaded)
            for name in integrators.METHODS.data
        }
        return lambda wildcards: lists[methods(wildcards)[0]]
    return script_sources(job.script, *methods, loaded=loaded)


def log_of(job):
    """Return the name of log and benchmark of a job: one with wildcards has that of its result."""
    file = job.files[0] if job.files else ""
    return os.path.splitext(file)[0] if "{" in file else job.name


#: Those with anything to study.
PRESENT = [study for study in STUDIES.values() if study.needs(CONFIG)]


for job in [job for study in PRESENT for job in study.jobs]:

    rule:
        name:
            # The target has its name.
            f"compute_{job.name}" if job.name in STUDIES else job.name
        input:
            **inputs_of(job.data),
            **job.given(CONFIG),
            **{name: f"results/{name}.sha256" for name in job.kernels},
            sources=sources_of(job),
        output:
            [result(file) for file in job.files or [f"{job.name}.nc"]],
        log:
            f"results/logs/{log_of(job)}.log",
        benchmark:
            f"results/benchmarks/{log_of(job)}.tsv"
        threads: job.threads
        priority: job.priority
        params:
            **{name: canonical(value) for name, value in job.params(CONFIG).items()},
            script=job.script,
            function=path_of(job.function),
        conda:
            "../envs/gearlib.yaml"
        script:
            "../scripts/{params.script}.py"


for study, table in [(study, one) for study in PRESENT for one in study.tables if one.function]:
    job = table.rule or f"{table.name}_table"

    rule:
        name:
            job
        input:
            **inputs_of(table.data),
            sources=script_sources("table", loaded=[path_of(table.function).split(":")[0]]),
        output:
            csv=f"results/{table.name}.csv",
            page=table_page(study, table),
        log:
            f"results/logs/{job}.log",
        benchmark:
            f"results/benchmarks/{job}.tsv"
        params:
            function=path_of(table.function),
            settings=canonical(table.settings(CONFIG)),
            gears=study.gears(CONFIG),
        conda:
            "../envs/gearlib.yaml"
        script:
            "../scripts/table.py"


for study, drawing in [
    (study, one) for study in PRESENT for one in study.drawings if one.wanted(CONFIG)
]:
    job = f"draw_{drawing.name or study.name}"
    log = os.path.join(job, *(f"{{{name}}}" for name in drawing.names(CONFIG)))

    rule:
        name:
            job
        input:
            **inputs_of(drawing.data),
            sources=script_sources(
                "draw", loaded=[f"gearlib.figures.{drawing.function.split('.')[0]}"]
            ),
        output:
            [
                figure(file, label, study.part, CAPTION_FILES[number])
                for number, (file, (label, _)) in enumerate(drawing.figures.items())
            ],
        log:
            f"results/logs/{log}.log",
        benchmark:
            f"results/benchmarks/{log}.tsv"
        params:
            draw=drawing.function,
            gears=study.gears(CONFIG),
            settings=canonical(drawing.settings(CONFIG)),
            absent=drawing.absent(CONFIG),
            dpi=CONFIG.figures.dpi,
        conda:
            "../envs/gearlib.yaml"
        script:
            "../scripts/draw.py"


for study in STUDIES.values():

    rule:
        name:
            study.name
        input:
            files_asked_by_name(study),
