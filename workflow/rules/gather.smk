"""Gather: the shards of an experiment into one dataset."""


use rule job as gather_resonance with:
    pathvars:
        job="gather_resonance",
    input:
        shards=resonance_shards(),
        sources=script_sources("gather"),
    output:
        dataset="results/resonance.nc",
    params:
        script="gather",
        gather="gather_resonance",


use rule job as gather_phase_planes with:
    pathvars:
        job="gather_phase_planes",
    input:
        shards=phase_plane_shards(),
        sources=script_sources("gather"),
    output:
        dataset="results/phase_planes.nc",
    params:
        script="gather",
        gather="gather_phase_planes",
