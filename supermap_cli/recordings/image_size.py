"""Whether an image is within the limits, before anything of it is unpacked."""

from __future__ import annotations

from supermap_cli.geometry.image_header import image_size
from supermap_cli.recordings.limits import Limits

_DENSE_PIXELS, _PIXELS_A_BYTE = 1 << 24, 16
"""Beyond 16 megapixels an image has at least one byte for 16 pixels; JPEG at its coarsest has one for some ten."""


class PixelLimitError(ValueError):
    """An image of more than the user's limit of pixels, which its bytes can well show: `pixels` would be enough."""

    def __init__(self, what: str, pixels: int) -> None:
        self.pixels = pixels
        super().__init__(what)


def check_size(data: bytes | memoryview, limits: Limits) -> None:
    """Raise `ValueError` for an image beyond the limit of pixels, and for one whose size its header does not say."""
    size = image_size(data)
    if size is None:
        raise ValueError("a compressed image that is no whole JPEG, PNG, TIFF, BMP or WebP and cannot be decoded")
    check_pixels(*size, len(data), limits)


def check_pixels(width: int, height: int, data_bytes: int, limits: Limits) -> None:
    """Raise `ValueError` for an image of no pixels, of more than the limit, or of more than its bytes can show."""
    most_shown = max(_DENSE_PIXELS, _PIXELS_A_BYTE * data_bytes)
    most = min(limits.image_pixels, most_shown)
    if width <= 0 or height <= 0:
        raise ValueError(f"an image of {width} x {height} pixels")
    if width * height > most:
        what = f"an image of {width} x {height} pixels in {data_bytes} bytes, the limit image_pixels allows {most}"
        raise PixelLimitError(what, width * height) if width * height <= most_shown else ValueError(what)
