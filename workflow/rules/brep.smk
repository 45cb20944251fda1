# brep: one closed solid, its parameters refined against the images.
# needs: views.h5, points.ply, primitives.h5.  makes: brep.step, brep.glb, brep.h5


rule brep:
    input:
        views=kept("views", "views.h5"),
        points=kept("points", "points.ply"),
        primitives=kept("primitives", "primitives.h5"),
    output:
        step=ensure(made("brep.step"), non_empty=True),
        glb=ensure(made("brep.glb"), non_empty=True),
        brep=ensure(made("brep.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/brep.log",
    benchmark:
        "benchmarks/{variant}/{object}/brep.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=3000,
    params:
        settings=settings("brep"),
        failure=failure("brep"),
        code=code("brep"),
    script:
        "../scripts/brep.py"
