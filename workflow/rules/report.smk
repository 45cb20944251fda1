# report: a page and a contact sheet per object, tables.
# needs: everything.  makes: view.html, sheet.png, tables


rule page:
    input:
        views=kept("views", "views.h5"),
        truth=truth,
        masks=kept("masks", "masks.h5"),
        surfels=kept("stage1", "stage1.ply"),
        evidence=kept("stage1", "stage1.h5"),
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
        expand(
            made("{file}"),
            variant=config["variants"],
            object=OBJECTS,
            file=["view.html", "sheet.png"],
        ),


rule tables:
    """The paper's tables with the stricter columns, for the configured objects and variants."""
    input:
        table=rules.metrics.output.table,
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
        groups={name: row.group for name, row in OBJECTS.items()},
        code=code_stamp("brepgaussian.report.tables"),
    script:
        "../scripts/tables.py"
