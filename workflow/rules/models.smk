"""Models: what larger ones would change in each scene; their choice and table."""


use rule job as compare_models with:
    pathvars:
        job="compare_models/{scene}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=script_sources("compare_models"),
    output:
        dataset="results/models/{scene}.nc",
    params:
        script="compare_models",
        cases=cases_of,
        question=question_of,
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        harmonics=CONFIG.models.harmonics,
        run=canonical(run_length()),
        starts=canonical(CONFIG.models.model_dump(include=STARTS)),


use rule job as model_table with:
    pathvars:
        job="model_table",
    input:
        comparisons=[f"results/models/{name}.nc" for name in CONFIG.scenes],
        sources=function_sources("gearlib.studies.model_comparison:write_csv", script="table"),
    output:
        csv="results/models.csv",
        page=table_page("models", "Models: table", EXPLANATIONS),
    params:
        script="table",
        function="gearlib.studies.model_comparison:write_csv",
        settings=canonical({"scenes": list(CONFIG.scenes)}),
