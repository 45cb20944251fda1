"""Rule `views`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("views", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.settings.base import build
    from brepgaussian.settings.views import ViewsSettings
    from brepgaussian.views.stage import make_views

    make_views(
        object_name=snakemake.wildcards.object,
        source=snakemake.params.row["source"],
        path=snakemake.params.row["path"],
        truth=snakemake.params.row["truth"],
        out_views=snakemake.output.views,
        out_truth=snakemake.output.get("truth"),
        settings=build(ViewsSettings, snakemake.params.settings, "views"),
        threads=snakemake.threads,
    )
