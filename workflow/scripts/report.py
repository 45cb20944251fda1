"""Rule `page`: an object's page and contact sheet from all its artifacts."""

from brepgaussian.jobs import job

with job("report", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.report.stage import make_report
    from brepgaussian.settings.base import build
    from brepgaussian.settings.report import ReportSettings

    make_report(
        object_name=snakemake.wildcards.object,
        views_path=snakemake.input.views,
        masks_path=snakemake.input.masks,
        stage1_ply=snakemake.input.surfels,
        stage2_path=snakemake.input.stage2,
        stage1_h5=snakemake.input.evidence,
        points_path=snakemake.input.points,
        primitives_path=snakemake.input.primitives,
        step_path=snakemake.input.step,
        brep_h5=snakemake.input.brep,
        truth_path=snakemake.input.truth or None,
        metrics_row=snakemake.input.row,
        out_html=snakemake.output.page,
        out_sheet=snakemake.output.sheet,
        settings=build(ReportSettings, snakemake.params.settings, "report"),
    )
