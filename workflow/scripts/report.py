"""Rule `page`: an object's page and contact sheet from all its artifacts."""

from brepgaussian.jobs import job

with job("report", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.report.stage import ObjectFiles, make_report
    from brepgaussian.settings.base import build
    from brepgaussian.settings.report import ReportSettings

    make_report(
        object_name=snakemake.wildcards.object,
        files=ObjectFiles(**dict(snakemake.input.items())),
        out_html=snakemake.output.page,
        out_sheet=snakemake.output.sheet,
        settings=build(ReportSettings, snakemake.params.settings, "report"),
    )
