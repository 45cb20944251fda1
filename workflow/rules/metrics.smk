# metrics: every object's scores against its truth, and the table of all of them.
# needs: brep.step, brep.h5, points.ply, views.h5, truth.h5 where known.  makes: metrics.csv


rule object_metrics:
    input:
        views=kept("views", "views.h5"),
        truth=truth,
        points=kept("points", "points.ply"),
        step=kept("brep", "brep.step"),
        brep=kept("brep", "brep.h5"),
    output:
        row=ensure(made("metrics.csv"), non_empty=True),
    log:
        "logs/{variant}/{object}/metrics.log",
    benchmark:
        "benchmarks/{variant}/{object}/metrics.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        benchmarks=benchmarks,
        settings=settings("metrics"),
        failure=failure("metrics"),
        code=code("metrics"),
    script:
        "../scripts/metrics.py"


rule metrics:
    input:
        rows=of_all("metrics", "metrics.csv"),
    output:
        table=report(
            ensure(f"{RESULTS}/metrics.csv", non_empty=True),
            caption="../report/metrics.rst",
            category="Metrics",
        ),
    log:
        "logs/metrics.log",
    benchmark:
        "benchmarks/metrics.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    params:
        variants=[variant for variant in config["variants"] for name in OBJECTS],
        code=code("metrics"),
    script:
        "../scripts/collect_metrics.py"
