"""Rule `benchmark_splatting`: speed of the renderer's backends."""

from brepgaussian.jobs import job

with job("benchmark", snakemake.log[0], snakemake.threads):
    from brepgaussian.splatting.benchmark import run

    threads = sorted({1, snakemake.threads})
    run(snakemake.output.table, snakemake.params.surfels, snakemake.params.pixels, threads)
