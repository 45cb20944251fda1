"""Rules `benchmark_stage1`, `benchmark_masks`, `benchmark_labels`: one object's rows from its artifacts."""

from brepgaussian.jobs import job

with job("benchmark", snakemake.log[0], snakemake.threads):
    from brepgaussian.report import benchmark

    rows_of = {
        "benchmark_stage1": benchmark.stage1_rows,
        "benchmark_masks": benchmark.masks_rows,
        "benchmark_labels": benchmark.labels_rows,
    }[snakemake.rule]
    benchmark.write_rows(rows_of([benchmark.Case(**case) for case in snakemake.params.cases]), snakemake.output.table)
