"""Rule `tables`: the joined metrics and other methods' rows to the paper's tables."""

from brepgaussian.jobs import job

with job("report", snakemake.log[0], snakemake.threads):
    from brepgaussian.report.tables import make_tables

    make_tables(
        snakemake.input.table, snakemake.params.groups, snakemake.output.tables, snakemake.input.get("others", [])
    )
