# report: a page and a contact sheet per object, other methods beside ours, tables.
# needs: everything.  makes: view.html, sheet.png, baselines.csv, point2cad.txt, external/*.csv, tables


rule page:
    input:
        views=kept("views", "views.h5"),
        truth=truth,
        masks=kept("masks", "masks.h5"),
        surfels=kept("stage1", "stage1.ply"),
        evidence=kept("stage1", "stage1.h5"),
        stage2=kept("stage2", "stage2.h5"),
        points=kept("points", "points.ply"),
        primitives=kept("primitives", "primitives.h5"),
        step=kept("brep", "brep.step"),
        brep=kept("brep", "brep.h5"),
        row=kept("metrics", "metrics.csv"),
    output:
        page=report(
            ensure(made("view.html"), non_empty=True),
            caption="../report/page.rst",
            category="Objects",
            labels={"object": "{object}", "variant": "{variant}", "what": "page"},
        ),
        sheet=report(
            ensure(made("sheet.png"), non_empty=True),
            caption="../report/sheet.rst",
            category="Objects",
            labels={
                "object": "{object}",
                "variant": "{variant}",
                "what": "contact sheet",
            },
        ),
    log:
        "logs/{variant}/{object}/report.log",
    benchmark:
        "benchmarks/{variant}/{object}/report.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=settings("report"),
        failure=failure("report"),
        code=code("report"),
    script:
        "../scripts/report.py"


rule pages:
    """All pages and contact sheets."""
    input:
        sorted(
            {
                path
                for file in ("view.html", "sheet.png")
                for path in of_all("report", file)
            }
        ),


rule baselines:
    """Plain baselines on our densified points: planes by RANSAC, region growing, a Poisson mesh."""
    input:
        points=kept("points", "points.ply"),
        truth=kept("views", "truth.h5"),
    output:
        rows=ensure(made("baselines.csv"), non_empty=True),
    log:
        "logs/{variant}/{object}/baselines.log",
    benchmark:
        "benchmarks/{variant}/{object}/baselines.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=settings("metrics"),
        code=code_stamp("brepgaussian.metrics.baselines"),
    script:
        "../scripts/baselines.py"


rule external:
    """Results of another method, scored like ours: `external` in config."""
    input:
        views=[
            artifact("full", name, "views", "views.h5")
            for name, row in OBJECTS.items()
            if has_truth(row)
        ],
        truth=[
            artifact("full", name, "views", "truth.h5")
            for name, row in OBJECTS.items()
            if has_truth(row)
        ],
    output:
        rows=ensure(f"{RESULTS}/external/{{method}}.csv", non_empty=True),
    log:
        "logs/external/{method}.log",
    benchmark:
        "benchmarks/external/{method}.tsv"
    wildcard_constraints:
        method=pattern(EXTERNAL),
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        objects=[name for name, row in OBJECTS.items() if has_truth(row)],
        folder=lambda wildcards: EXTERNAL[wildcards.method]["folder"],
        frame=lambda wildcards: EXTERNAL[wildcards.method].get("frame", "unit"),
        settings=VARIANTS.settings("full", "metrics"),
        code=code_stamp("brepgaussian.metrics.external"),
    script:
        "../scripts/external.py"


rule point2cad:
    """Our labelled points as Point2CAD reads them: x y z label."""
    input:
        points=kept("points", "points.ply"),
    output:
        text=ensure(made("point2cad.txt"), non_empty=True),
    log:
        "logs/{variant}/{object}/point2cad.log",
    benchmark:
        "benchmarks/{variant}/{object}/point2cad.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    params:
        code=code_stamp("brepgaussian.report.export"),
    script:
        "../scripts/point2cad.py"


rule exports:
    """The labelled points of all objects, for Point2CAD."""
    input:
        sorted(set(of_all("points", "point2cad.txt"))),


rule tables:
    """The paper's tables with the stricter columns, for the configured objects and variants."""
    input:
        table=rules.metrics.output.table,
        others=other_methods(),
    output:
        tables=report(
            directory(f"{RESULTS}/tables"),
            patterns=["{name}.md"],
            caption="../report/metrics.rst",
            category="Tables",
        ),
    log:
        "logs/tables.log",
    benchmark:
        "benchmarks/tables.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    params:
        groups=GROUPS,
        code=code_stamp("brepgaussian.report.tables"),
    script:
        "../scripts/tables.py"
