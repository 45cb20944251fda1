# What the benchmarks cover (`benchmark` in config), and which artifacts their rows score.
BENCHMARK = config.get("benchmark") or {}
# table -> stage -> files of each variant that its rows are made of
SCORED = {
    "stage1": {"views": ["truth.h5"], "stage1": ["stage1.ply", "stage1.h5"]},
    "masks": {"views": ["truth.h5"], "masks": ["masks.h5"], "stage2": ["stage2.h5"]},
    "labels": {"views": ["truth.h5"], "points": ["points.ply"]},
}
try:
    MEASURED = {
        name: row
        for name, row in selected(
            KNOWN, BENCHMARK.get("objects") or [], "benchmark.objects"
        ).items()
        if has_truth(row)
    }
    for table in SCORED:
        for variant in BENCHMARK.get(table, []):
            VARIANTS.settings(variant, "views")
except BrepGaussianError as error:
    raise WorkflowError(str(error))
# the assembly is measured on clouds of bundled parts, which are made with the benchmark's seeds
MEASURED_PARTS = {name: row for name, row in MEASURED.items() if row.source == "part"}


def benchmark_cases(table):
    """A params function: what each row of an object's table scores."""

    def cases(wildcards):
        name = wildcards.object
        return [
            {
                "name": name,
                "group": KNOWN[name].group,
                "variant": variant,
                "views": VARIANTS.settings(variant, "views"),
                "masks": VARIANTS.settings(variant, "masks"),
                "files": {
                    file: artifact(variant, name, stage, file)
                    for stage, files in SCORED[table].items()
                    for file in files
                },
                "benchmarks": {
                    stage: benchmark_file(variant, name, stage)
                    for stage in SCORED[table]
                },
            }
            for variant in BENCHMARK[table]
        ]

    return cases


def benchmark_inputs(table):
    """An input function: the artifacts that an object's table scores."""
    cases = benchmark_cases(table)
    return lambda wildcards: sorted(
        {path for case in cases(wildcards) for path in case["files"].values()}
    )


def object_tables(wildcards):
    """The tables of all objects that a benchmark joins."""
    objects = MEASURED_PARTS if wildcards.table == "brep" else MEASURED
    return [f"{RESULTS}/benchmark/{wildcards.table}/{name}.csv" for name in objects]
