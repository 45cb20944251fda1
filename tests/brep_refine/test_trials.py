"""The images decide: over-segmented and bent solids become the simpler ones that they show, and no more."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.artifacts.points import Points
from brepgaussian.artifacts.primitives import Primitive, Primitives
from brepgaussian.brep import buildings, trials
from brepgaussian.brep.budget import Budget
from brepgaussian.brep.damage import damaged
from brepgaussian.brep.job import Attempt, Rung
from brepgaussian.brep.ladder import climb, make_job
from brepgaussian.brep.polish import Polished, badness
from brepgaussian.brep.refine.accept import Acceptance
from brepgaussian.brep.refine.refinement import better
from brepgaussian.brep.shown import ShownEdge
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.verdict import Verdict
from brepgaussian.brep.worker import Worker
from brepgaussian.geometry.surfaces import cone
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings
from brepgaussian.settings.views import ViewsSettings

SETTINGS = BrepSettings()


@pytest.fixture(scope="module")
def worker():
    with Worker() as one:
        yield one


@pytest.fixture(scope="module")
def part():
    """Views, points and primitives of a plate with a hole."""
    from brepgaussian.views.source_rendered import load_part

    options = ViewsSettings(rendered_views=12, image_size=400, interreflection=0.0)
    loaded = load_part("block_hole:4", "block_hole:4", "", True, options, 1)
    points = damaged(loaded.truth, 0.002, 0.01, "none", 4)
    return loaded.views, points, primitives_of(points, PrimitivesSettings())


def solve(worker, part, primitives, settings=SETTINGS):
    views, points = part[:2]
    return climb(worker, make_job(views, points, primitives, settings), points, views)


def test_the_right_solid_is_left_alone(worker, part):
    outcome = solve(worker, part, part[2])
    assert outcome.report["faces"] == 7
    assert outcome.report["accepted"]
    assert not [t for t in outcome.report.get("trials", []) if not t["fault"]]


def test_a_shallow_cone_becomes_the_plane_that_the_images_show(worker, part):
    items = list(part[2].items)
    index = next(i for i, p in enumerate(items) if p.surface.kind == "plane")
    surface, xyz = items[index].surface, part[1].xyz[items[index].support]
    middle = xyz.mean(axis=0) + 0.5 * surface.frame()[0]
    bent = cone(surface.project(middle[None])[0], -surface.axis, 0.5, np.radians(88.5))
    items[index] = Primitive(bent, items[index].label, items[index].support, items[index].rms)
    outcome = solve(worker, part, Primitives(tuple(items), sigma=part[2].sigma))
    assert sorted(s.kind for s in outcome.surfaces) == ["cylinder"] + ["plane"] * 6
    assert outcome.report["accepted"]
    none = solve(worker, part, Primitives(tuple(items), sigma=part[2].sigma), BrepSettings(simplify_solids=0))
    assert "cone" in {s.kind for s in none.surfaces}
    plain = solve(worker, part, Primitives(tuple(items), sigma=part[2].sigma), BrepSettings(simplify=False))
    assert "cone" in {s.kind for s in plain.surfaces}
    assert badness(outcome.report, SETTINGS) < badness(plain.report, SETTINGS)


def test_a_chamfer_without_points_is_found_in_the_images(worker):
    from brepgaussian.views.source_rendered import load_part

    options = ViewsSettings(rendered_views=12, image_size=400, interreflection=0.0)
    loaded = load_part("stepped_shaft", "stepped_shaft", "", True, options, 1)
    cones = [k for k, kind in enumerate(loaded.truth.face_types) if kind == "cone"]
    points = damaged(loaded.truth, 0.002, 0.0, "none", 1)
    keep = ~np.isin(loaded.truth.point_face, cones)
    label = np.unique(points.label[keep], return_inverse=True)[1].astype(np.int32)
    points = Points(points.xyz[keep], points.normals[keep], points.edge[keep], label, points.curve[keep])
    outcome = solve(worker, (loaded.views, points), primitives_of(points, PrimitivesSettings()))
    assert "cone" in {outcome.surfaces[f.surface].kind for f in outcome.structure.faces}
    assert outcome.report["faces"] == len(loaded.truth.face_types)
    assert outcome.report["accepted"]


def test_badness_is_in_units_of_the_limits():
    at_limit = {"silhouette_px": SETTINGS.accept_silhouette_px, "mask_iou": SETTINGS.accept_iou}
    assert badness(at_limit, SETTINGS) == pytest.approx(2)
    assert badness({"silhouette_px": 0.0, "mask_iou": 1.0}, SETTINGS) == 0
    assert badness(at_limit | {"astray": SETTINGS.accept_astray}, SETTINGS) == pytest.approx(3)
    assert badness(at_limit | {"disputed": SETTINGS.accept_disputed}, SETTINGS) == 2  # up to it, it may be chance
    assert badness(at_limit | {"disputed": 3 * SETTINGS.accept_disputed}, SETTINGS) == pytest.approx(4)
    assert badness({"silhouette_px": None, "mask_iou": 1.0}, SETTINGS) == float("inf")


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        ((0.05, 0.9990, 0.0, True), True),  # accepted now
        ((0.119, 0.9995, 0.0, False), False),  # the masks gain, the worst edge loses
        ((0.104, 0.9995, 0.0, False), True),
        ((0.05, 0.9980, 0.0, False), False),  # the other way round
        ((float("nan"), 0.9995, 0.0, False), True),
    ],
)
def test_short_of_acceptance_no_figure_may_get_clearly_worse(after, expected):
    assert better(Acceptance(*after), Acceptance(0.101, 0.9987, 0.0, False)) is expected


def test_what_silhouettes_refuse_by_far_is_not_refined(part):
    class Hollow:
        def call(self, *_):
            return Attempt("support", b"hollow", Verdict((), iou=0.5))

    best = Polished(Attempt("support", b"solid", Verdict((), iou=0.99)), {"accepted": False})
    job = make_job(*part, SETTINGS)
    one = trials.Trials(Hollow(), None, job, Rung("support", 0.04), best, Budget(2, 2))  # no views: refining would fail
    assert not one._tried([Change("something else", (), ())], simpler=False)
    assert one.notes == [{"changes": ["something else"], "fault": "silhouettes are off by far"}]
    assert one.left.refinements == 2


def test_one_solid_of_two_rungs_is_refined_once(part, monkeypatch):
    verdict = Verdict((), iou=0.99, faces=7, edges=15, vertices=10, volume=0.3)

    class Twice:
        def call(self, *_):
            return Attempt("any", b"solid", verdict)

    asked = []

    def refined(worker, job, rung, attempt, views, *_):
        asked.append(rung.name)
        return Polished(attempt, {"accepted": False, "refined": True, "silhouette_px": 0.5, "mask_iou": 0.99})

    monkeypatch.setattr(trials, "polish", refined)
    best = Polished(Attempt("wide", b"solid", verdict), refined(None, None, Rung("", 0), None, None).report)
    asked.clear()
    one = trials.Trials(Twice(), None, make_job(*part, SETTINGS), Rung("wide", 0.12), best, Budget(4, 4))
    assert not one._tried([Change("something else", (), ())], simpler=False)
    assert asked == ["support"]
    assert one.notes[0]["fault"].startswith("the images agree little better")


@pytest.mark.parametrize(("mended", "expected"), [(True, ["simpler", "mend", "simpler"]), (False, ["simpler", "mend"])])
def test_what_a_mend_puts_right_is_simplified_again(part, monkeypatch, mended, expected):
    asked = []

    def simplified(one):
        asked.append("simpler")
        one.refused.add("two floors as one plane")

    def mend(one):
        asked.append("mend")
        if mended:
            one.best = Polished(one.best.attempt, {"accepted": True})

    for name, step in {"bordered": None, "rounded": None, "_simplified": simplified, "_mended": mend}.items():
        monkeypatch.setattr(trials.Trials, name, step or (lambda one: None))
    best = Polished(Attempt("support", b"solid", Verdict((), iou=0.99)), {"accepted": True})
    job = make_job(*part, SETTINGS)
    one = trials.Trials(None, None, job, Rung("support", 0.04), best, Budget(0, 0))
    assert one.run().report == {"accepted": True}
    assert asked == expected
    assert one.left.refinements == (SETTINGS.simplify_trials if mended else 0)


@pytest.mark.parametrize(("on", "expected"), [((0, 1, 2), [False]), ((0, 1), [False, True]), (None, [False, True])])
def test_fillets_are_rolled_where_no_solid_has_them(part, monkeypatch, on, expected):
    """Sheets that only touch give none, or one without the fillet."""
    tried = []

    class Leaving:
        def call(self, name, args, limit):
            tried.append(args[0].clear)
            faces = tuple(SimpleNamespace(surface=k) for k in on or ())
            verdict = Verdict((), iou=0.5, structure=SimpleNamespace(faces=faces, edges=()))
            primitives = tuple(p.primitive for p in args[0].patches)
            return Attempt("support", None if on is None else b"solid", verdict, primitives=primitives)

    job = make_job(*part, SETTINGS)
    job = replace(job, patches=job.patches[:3])
    monkeypatch.setattr(buildings, "rolled", lambda job, noise: iter([replace(job, clear=True)]))  # told apart by that
    best = Polished(Attempt("support", b"solid", Verdict((), iou=0.99)), {"accepted": True})
    one = trials.Trials(Leaving(), None, job, Rung("support", 0.04), best, Budget(9, 9))
    assert not one._tried([Change("a fillet", (2,), (job.patches[2],), smooth=True)], simpler=False)
    assert tried == expected
    tried.clear()
    one.refused.clear()
    assert not one._tried([Change("no fillet", (2,), (job.patches[2],))], simpler=False)
    assert tried == [False]


def test_edges_too_faint_to_be_told_are_not_lost():
    shown = tuple(ShownEdge(np.zeros((2, 3)), 0.05, 30, 0.003, surfaces=pair) for pair in ((0, 1), (1, 2), (2, 3)))
    known = Polished(Attempt("support", b"solid", Verdict(())), {}, shown)
    assert [e.surfaces for e in trials._without_edges(known, {2}).shown] == [(0, 1)]
    assert trials._without_edges(known, set()).shown == shown


@pytest.mark.parametrize(("caps", "fault"), [(1, "a face is guessed instead"), (0, "silhouettes are off by far")])
def test_a_face_that_is_guessed_is_no_simpler_one(part, caps, fault):
    def solid(faces, **figures):
        structure = SimpleNamespace(faces=[SimpleNamespace(surface=-1)] * faces)
        return Attempt("support", bytes(faces), Verdict((), structure=structure, **figures))

    class Capped:
        def call(self, *_):
            return solid(8, iou=0.5, caps=caps)

    best = Polished(solid(9, iou=0.99), {"accepted": True})
    one = trials.Trials(Capped(), None, make_job(*part, SETTINGS), Rung("support", 0.04), best, Budget(2, 2))
    assert not one._tried([Change("without the end of a slot", (), ())])
    assert one.notes[0]["fault"] == fault


def test_fillets_that_are_tried_leave_the_budget_of_others_alone(part, monkeypatch):
    job = make_job(*part, SETTINGS)
    structure = SimpleNamespace(faces=(), edges=())
    best = Polished(Attempt("support", b"solid", Verdict((), structure=structure), job.patches), {"accepted": True})
    one = trials.Trials(None, None, job, Rung("support", 0.04), best, Budget(7, 3))
    spent = []

    def tried(self, changes, **_):
        spent.append((self.left.solids, self.left.refinements))
        self.left.refined(9)
        return False

    monkeypatch.setattr(trials.Trials, "_tried", tried)
    monkeypatch.setattr(trials.Trials, "_refined", lambda self: self.job)
    fillets = [Change(f"fillet {k}", (k,), ()) for k in range(2)]
    assert not one._filleted(lambda *_: fillets, lambda *_: True)
    assert spent == [(4, 2), (4, 1)]
    assert (one.left.solids, one.left.refinements) == (7, 3)
