"""Rule `metrics`: the rows of all objects to one table."""

from brepgaussian.jobs import job

with job("metrics", snakemake.log[0], snakemake.threads) as log:
    from brepgaussian.metrics.table import collect, read_rows
    from brepgaussian.report.runs import summary_line

    rows = list(zip(snakemake.input.rows, snakemake.params.variants, strict=True))
    collect(rows, [], snakemake.output.table)
    log.info(summary_line(read_rows(snakemake.output.table)))
