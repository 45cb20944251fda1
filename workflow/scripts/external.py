"""Rule `external`: another method's files to rows of metrics."""

from brepgaussian.jobs import job

with job("metrics", snakemake.log[0], snakemake.threads):
    from brepgaussian.metrics.external import score_external
    from brepgaussian.settings.base import build
    from brepgaussian.settings.metrics import MetricsSettings

    files = zip(snakemake.input.views, snakemake.input.truth, strict=True)
    score_external(
        folder=snakemake.params.folder,
        method=snakemake.wildcards.method,
        objects=dict(zip(snakemake.params.objects, files, strict=True)),
        out_csv=snakemake.output.rows,
        settings=build(MetricsSettings, snakemake.params.settings, "metrics"),
        frame=snakemake.params.frame,
    )
