# stage1: 2D Gaussians from a visual hull, with an edge value each.
# needs: views.h5, masks.h5.  makes: stage1.ply, stage1.h5


rule stage1:
    input:
        views=kept("views", "views.h5"),
        masks=kept("masks", "masks.h5"),
    output:
        surfels=ensure(made("stage1.ply"), non_empty=True),
        evidence=ensure(made("stage1.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/stage1.log",
    benchmark:
        "benchmarks/{variant}/{object}/stage1.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=3000,
    params:
        settings=settings("stage1"),
        failure=failure("stage1"),
        code=code("stage1"),
    script:
        "../scripts/stage1.py"
