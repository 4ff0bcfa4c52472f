"""The report's own page: orbits over a grid of tunings, and the page on which to choose them."""


use rule job as report_orbits with:
    pathvars:
        job="report_orbits",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.pages.report.orbits:compute"),
    output:
        dataset="results/report_orbits.nc",
    params:
        script="compute",
        function="gearlib.pages.report.orbits:compute",
        pairs=canonical({name: CONFIG.pair_parameters(name) for name in CONFIG.dampings}),
        tunings=grid_of(CONFIG.report_page),
        run=canonical(run_length() | {"samples_per_period": CONFIG.report_page.samples_per_period}),
        periods_shown=CONFIG.report_page.periods_shown,


use rule job as draw_report_page with:
    pathvars:
        job="draw_report_page",
    input:
        resonance=rules.gather_resonance.output.dataset,
        orbits=rules.report_orbits.output.dataset,
        sources=script_sources("draw_report_page"),
    output:
        page="results/report/index.html",
    params:
        script="draw_report_page",
        colours=canonical(CONFIG.figures.colours),
