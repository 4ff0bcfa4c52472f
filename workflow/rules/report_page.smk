"""The report's own page, on which tunings are chosen."""


use rule job as draw_report_page with:
    pathvars:
        job="draw_report_page",
    input:
        resonance="results/resonance.nc",
        orbits="results/report_orbits.nc",
        sources=script_sources("draw_report_page"),
    output:
        page="results/report/index.html",
    params:
        script="draw_report_page",
        gears=STUDIES["report_page"].gears(CONFIG),
        colours=canonical(CONFIG.figures.colours),
