"""What is proven of the orbits, in ball arithmetic, as a file that a second program can check and as a table."""


use rule job as compute_certificates with:
    pathvars:
        job="certificates",
    input:
        kernels=rules.compile_kernels.output.stamp,
        branches=expand("results/branches/{damping}.nc", damping=CONFIG.dampings),
        sources=script_sources("certificates"),
    output:
        json="results/certificates.json",
        csv="results/certificates.csv",
        page=page_of("certificates"),
    params:
        script="certificates",
        gears=STUDIES["certificates"].gears(CONFIG),
        # Without python-flint nothing is proven, and the file is an empty list.
        flint=find_spec("flint") is not None,
        pairs=canonical(pairs_of(CONFIG)),
        tunings=CONFIG.phase_planes.tunings,
        whole=CONFIG.certificates.all_points,
