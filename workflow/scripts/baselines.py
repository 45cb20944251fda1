"""Rule `baselines`: one object's points to the rows of the baselines."""

from brepgaussian.jobs import job

with job("metrics", snakemake.log[0], snakemake.threads):
    from brepgaussian.metrics.baselines import write_baselines
    from brepgaussian.settings.base import build
    from brepgaussian.settings.metrics import MetricsSettings

    write_baselines(
        object_name=snakemake.wildcards.object,
        points_path=snakemake.input.points,
        truth_path=snakemake.input.truth,
        out_csv=snakemake.output.rows,
        settings=build(MetricsSettings, snakemake.params.settings, "metrics"),
    )
