"""Rule `benchmark_table`: the tables of all objects to one."""

from brepgaussian.jobs import job

with job("benchmark", snakemake.log[0], snakemake.threads):
    from brepgaussian.report.benchmark import join

    join(snakemake.input.tables, snakemake.output.table)
