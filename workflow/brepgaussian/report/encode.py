"""Arrays and pictures as text inside a page."""

import base64
import html
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

POSITION_STEPS = 16_000  # steps a unit length; int16 then reaches two unit lengths from the centre
_JPEG_QUALITY = 88


def positions(points: NDArray[np.floating]) -> str:
    """(N, 3) unit-frame points as int16 steps from the centre of the unit frame."""
    steps = np.round((np.asarray(points, float) - 0.5) * POSITION_STEPS)
    return packed(np.clip(steps, -32767, 32767).astype("<i2"))


def directions(vectors: NDArray[np.floating]) -> str:
    """(N, 3) unit vectors as int8, 127 for 1."""
    return packed(np.round(np.clip(vectors, -1, 1) * 127).astype("<i1"))


def lengths(vectors: NDArray[np.floating]) -> str:
    """(N, 3) vectors in unit lengths as int16 steps."""
    return packed(np.clip(np.round(np.asarray(vectors) * POSITION_STEPS), -32767, 32767).astype("<i2"))


def rgb(colors: NDArray[np.floating]) -> str:
    """(N, 3) colours in 0..1 as bytes."""
    return packed(to_bytes(colors))


def to_bytes(colors: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Colours in 0..1 as 0..255."""
    return np.round(np.clip(colors, 0, 1) * 255).astype(np.uint8)


def packed(array: NDArray[Any]) -> str:
    """Base64 of an array's bytes, row by row."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def jpeg(image: NDArray[np.floating]) -> str:
    """A data URI of a (H, W, 3) picture in 0..1."""
    import cv2

    data = cv2.imencode(".jpg", to_bytes(image)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    return f"data:image/jpeg;base64,{packed(data)}"


def png(image: NDArray[np.uint8]) -> str:
    """A data URI of a (H, W, 4) uint8 RGBA picture."""
    import cv2

    data = cv2.imencode(".png", np.ascontiguousarray(image[..., [2, 1, 0, 3]]), [cv2.IMWRITE_PNG_COMPRESSION, 6])[1]
    return f"data:image/png;base64,{packed(data)}"


def data_uri(content: bytes, kind: str) -> str:
    """A data URI of a file."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def script_json(value: Any) -> str:
    """JSON that may stand inside a script element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def escape(value: Any) -> str:
    """Text for HTML; numbers short, flags as words, None as a dash."""
    if value is None or value == "":
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{int(value):,}" if value.is_integer() and abs(value) < 1e9 else f"{value:.4g}"
    return html.escape(str(value))
