"""Rule `metrics`: the rows of all objects to one table."""

from pathlib import Path

from brepgaussian.jobs import job

with job("metrics", snakemake.log[0], snakemake.threads):
    from brepgaussian.metrics.table import collect

    collect([Path(row) for row in snakemake.input.rows], [], snakemake.output.table)
