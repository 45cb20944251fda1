# points: samples of the surfels with patch labels and edge instances.
# needs: views.h5, masks.h5, stage1.ply, stage1.h5, stage2.h5.  makes: points.ply


rule points:
    input:
        views=kept("views", "views.h5"),
        masks=kept("masks", "masks.h5"),
        surfels=kept("stage1", "stage1.ply"),
        evidence=kept("stage1", "stage1.h5"),
        stage2=kept("stage2", "stage2.h5"),
    output:
        points=ensure(made("points.ply"), non_empty=True),
    log:
        "logs/{variant}/{object}/points.log",
    benchmark:
        "benchmarks/{variant}/{object}/points.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=settings("points"),
        failure=failure("points"),
        code=code("points"),
    script:
        "../scripts/points.py"
