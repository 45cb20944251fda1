"""Settings of the `views` stage. Sources of objects, rendering, truth."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class ViewsSettings:
    """Sources of objects, rendering, truth."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    view_count: int = setting(
        0, "Use this many of an object's views, evenly chosen; 0 uses all.", minimum=0, maximum=1000
    )
    rendered_views: int = setting(50, "Cameras around a rendered object.", minimum=8, maximum=500)
    image_size: int = setting(800, "Width and height of rendered images.", unit="px", minimum=64, maximum=4096)
    focal: float = setting(
        1111.111, "Focal length of rendered images at a size of 800 px; scales with the size.", unit="px", minimum=100
    )
    camera_distance: float = setting(
        4.0, "Distance of rendering cameras from the world's origin, as in ABC-NEF.", unit="unit frame", minimum=1.5
    )
    subsamples: int = setting(
        6, "Rays per pixel and axis where a pixel holds an edge or a silhouette (6: 36 rays).", minimum=1, maximum=16
    )
    interreflection: float = setting(
        0.9,
        "Albedo with which faces light each other in renderings (0.9: holes nearly as bright as ABC-NEF's); 0 is none.",
        minimum=0,
        maximum=0.95,
    )
    noise: float = setting(
        0.0, "Standard deviation of Gaussian noise added to the images.", unit="grey level", minimum=0, maximum=64
    )
    jpeg_quality: int = setting(0, "Pass the images through JPEG of this quality; 0 is off.", minimum=0, maximum=100)
    denoise: bool = setting(True, "Smooth the images by non-local means where their noise is 0.75 grey levels or more.")
    truth_points: int = setting(20000, "Points of the truth, uniform by area.", minimum=1000, maximum=1000000)
    curve_spacing: float = setting(
        0.005, "Distance of samples on the truth's sharp curves.", unit="unit frame", minimum=1e-4
    )
    sharp_deg: float = setting(
        10.0, "Faces that meet at more than this angle make a sharp curve.", unit="deg", minimum=0.1, maximum=90
    )
    mesh_deflection: float = setting(
        2e-5, "Largest distance of the truth's triangles from its surfaces.", unit="unit frame", minimum=1e-6
    )
    mesh_angle_deg: float = setting(
        5.0, "Largest angle between neighbouring triangles of the truth.", unit="deg", minimum=0.5, maximum=45
    )
    face_ids: bool = setting(True, "Store the visible face of every pixel with the truth.")
