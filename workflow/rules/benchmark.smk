# benchmark: stages on their own against the truth, a table each; what they cover is `benchmark` in config.
# needs: artifacts of variants, or nothing.  makes: results/benchmark/{stage1,masks,labels,brep,splatting}.csv


rule benchmark_stage1:
    """Stage 1: surfels, concave faces and 3D edges, by method."""
    input:
        benchmark_inputs("stage1"),
    output:
        table=ensure(f"{RESULTS}/benchmark/stage1/{{object}}.csv", non_empty=True),
    log:
        "logs/benchmark/stage1/{object}.log",
    benchmark:
        "benchmarks/benchmark/stage1/{object}.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        cases=benchmark_cases("stage1"),
        code=code_stamp("brepgaussian.splatting.evaluate"),
    script:
        "../scripts/benchmark_rows.py"


use rule benchmark_stage1 as benchmark_masks with:
    input:
        benchmark_inputs("masks"),
    output:
        table=ensure(f"{RESULTS}/benchmark/masks/{{object}}.csv", non_empty=True),
    log:
        "logs/benchmark/masks/{object}.log",
    benchmark:
        "benchmarks/benchmark/masks/{object}.tsv"
    params:
        cases=benchmark_cases("masks"),
        code=code_stamp("brepgaussian.masks.benchmark"),


use rule benchmark_stage1 as benchmark_labels with:
    input:
        benchmark_inputs("labels"),
    output:
        table=ensure(f"{RESULTS}/benchmark/labels/{{object}}.csv", non_empty=True),
    log:
        "logs/benchmark/labels/{object}.log",
    benchmark:
        "benchmarks/benchmark/labels/{object}.tsv"
    params:
        cases=benchmark_cases("labels"),
        code=code_stamp("brepgaussian.points.benchmark"),


rule benchmark_brep:
    """The assembly alone, on noisy and damaged clouds of one bundled part."""
    output:
        table=ensure(f"{RESULTS}/benchmark/brep/{{object}}.csv", non_empty=True),
    log:
        "logs/benchmark/brep/{object}.log",
    benchmark:
        "benchmarks/benchmark/brep/{object}.tsv"
    wildcard_constraints:
        object=pattern(MEASURED_PARTS),
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        part=lambda wildcards: KNOWN[wildcards.object].path.partition(":")[0],
        group=lambda wildcards: KNOWN[wildcards.object].group,
        plan={
            name: BENCHMARK.get(name, [])
            for name in ("sigmas", "wrong_labels", "damages", "seeds")
        },
        code=code_stamp("brepgaussian.brep.benchmark"),
    script:
        "../scripts/benchmark_brep.py"


rule benchmark_table:
    """A benchmark's table of all objects."""
    input:
        tables=object_tables,
    output:
        table=report(
            ensure(f"{RESULTS}/benchmark/{{table}}.csv", non_empty=True),
            caption="../report/benchmark.rst",
            category="Benchmarks",
            labels={"table": "{table}"},
        ),
    log:
        "logs/benchmark/{table}.log",
    benchmark:
        "benchmarks/benchmark/{table}.tsv"
    wildcard_constraints:
        table="stage1|masks|labels|brep",
    conda:
        "../../envs/environment.yaml"
    threads: 1
    params:
        code=code_stamp("brepgaussian.report.benchmark"),
    script:
        "../scripts/benchmark_table.py"


rule benchmark_splatting:
    """Speed of the renderer and of a training step; takes all cores, to measure alone."""
    output:
        table=report(
            ensure(f"{RESULTS}/benchmark/splatting.csv", non_empty=True),
            caption="../report/benchmark.rst",
            category="Benchmarks",
            labels={"table": "splatting"},
        ),
    log:
        "logs/benchmark/splatting.log",
    benchmark:
        "benchmarks/benchmark/splatting.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: workflow.cores or 1
    resources:
        mem_mb=4000,
    params:
        surfels=BENCHMARK.get("surfels", []),
        pixels=BENCHMARK.get("pixels", []),
        code=code_stamp("brepgaussian.splatting.benchmark"),
    script:
        "../scripts/benchmark_splatting.py"
