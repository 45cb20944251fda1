"""Rule `benchmark_brep`: the assembly alone on clouds of one part."""

from brepgaussian.jobs import job

with job("benchmark", snakemake.log[0], snakemake.threads):
    from brepgaussian.report.benchmark import brep_rows, write_rows

    rows = brep_rows(snakemake.params.part, snakemake.params.group, snakemake.params.plan)
    write_rows(rows, snakemake.output.table)
