# stage2: a patch feature per surfel on frozen geometry, and patch ids per view.
# needs: views.h5, masks.h5, stage1.ply.  makes: stage2.h5


rule stage2:
    input:
        views=kept("views", "views.h5"),
        masks=kept("masks", "masks.h5"),
        surfels=kept("stage1", "stage1.ply"),
    output:
        stage2=ensure(made("stage2.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/stage2.log",
    benchmark:
        "benchmarks/{variant}/{object}/stage2.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=3000,
    params:
        settings=settings("stage2"),
        failure=failure("stage2"),
        code=code("stage2"),
    script:
        "../scripts/stage2.py"
