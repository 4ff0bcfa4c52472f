"""Claims: the paper's statements against the computed data."""


use rule job as compute_claims with:
    pathvars:
        job="claims",
    input:
        resonance="results/resonance.nc",
        phase_planes="results/phase_planes.nc",
        phase_lag="results/phase_lag.nc",
        jump="results/jump.nc",
        scenes=[f"results/scenes/{name}.nc" for name in CONFIG.scenes],
        sources=script_sources("claims"),
    output:
        csv="results/claims.csv",
        page=page_of("claims"),
        markdown="results/claims.md",
    params:
        script="claims",
        gears=STUDIES["claims"].gears(CONFIG),
        pair=canonical(CONFIG.gear_pair.model_dump()),
        dampings=canonical(CONFIG.model_dump()["dampings"]),
