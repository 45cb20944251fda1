"""Rule `point2cad`: labelled points as text."""

from brepgaussian.jobs import job

with job("report", snakemake.log[0], snakemake.threads):
    from brepgaussian.report.export import export_point2cad

    export_point2cad(snakemake.input.points, snakemake.output.text)
