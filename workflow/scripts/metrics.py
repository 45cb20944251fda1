"""Rule `metrics`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("metrics", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.metrics.stage import score_object
    from brepgaussian.settings.base import build
    from brepgaussian.settings.metrics import MetricsSettings

    score_object(
        object_name=snakemake.wildcards.object,
        variant=snakemake.wildcards.variant,
        views_path=snakemake.input.views,
        truth_path=snakemake.input.truth or None,
        points_path=snakemake.input.points,
        step_path=snakemake.input.step,
        brep_h5=snakemake.input.brep,
        out_csv=snakemake.output.row,
        benchmark_files=snakemake.params.benchmarks,
        settings=build(MetricsSettings, snakemake.params.settings, "metrics"),
        threads=snakemake.threads,
    )
