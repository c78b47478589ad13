"""Images as input tensors: resized, scaled and normalised as the model was trained.

The file `preprocessor_config.json` beside a model says how, in the form of Hugging Face's image processors; it is data,
and of what it does not say the family's own values are taken. Resizing is Pillow's, which the processors define theirs
by: other libraries sample between pixels otherwise, which moves scores by hundredths.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from supermap_cli.errors import SupermapError
from supermap_cli.geometry.arrays import Float32Array, UInt8Array
from supermap_cli.input_files import read_text

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
"""Of red, green and blue from 0 to 1, over ImageNet's training images (torchvision's models)."""
CLIP_MEAN = (0.48145466, 0.4578275, 0.40821073)
CLIP_STD = (0.26862954, 0.26130258, 0.27577711)
"""The same over CLIP's training images (Radford et al. 2021, `clip.py`)."""

CONFIGURATION = "preprocessor_config.json"

_LARGEST_SIDE_PX = 8192
"""Pixels; a larger input is no detector's. Chosen."""


@dataclass(frozen=True)
class ImageFormat:
    """How a model takes images.

    Either `size_px` (height, width), which the image is stretched to, or `shortest_px`, which its shorter side becomes,
    unless the longer one became more than `longest_px`; then the middle `crop_px` (height, width) are cut out. Values
    from 0 to 255 times `scale`, less `mean`, over `std`. `resampling` is Pillow's number: 2 bilinear, 3 bicubic.
    """

    size_px: tuple[int, int] | None = None
    shortest_px: int = 800
    longest_px: int | None = None
    crop_px: tuple[int, int] | None = None
    mean: tuple[float, float, float] = IMAGENET_MEAN
    std: tuple[float, float, float] = IMAGENET_STD
    scale: float = 1 / 255
    resampling: int = 2

    def input_size(self, image_size: tuple[int, int]) -> tuple[int, int]:
        """The (height, width) that an image of (height, width) is resized to."""
        if self.size_px is not None:
            return self.size_px
        return shortest_edge_size(image_size, self.shortest_px, self.longest_px)

    def tensor(self, rgb: UInt8Array, size_px: tuple[int, int]) -> Float32Array:
        """An image (h, w, 3) resized to (height, width) and normalised, (1, 3, height, width)."""
        values = resized(rgb, size_px, self.resampling)
        return self.normalised(values if self.crop_px is None else middle(values, self.crop_px))

    def normalised(self, rgb: UInt8Array) -> Float32Array:
        """An image (h, w, 3) as (1, 3, h, w), normalised."""
        shades = rgb.astype(np.float32) * np.float32(self.scale)
        normal = (shades - np.array(self.mean, np.float32)) / np.array(self.std, np.float32)
        return np.ascontiguousarray(normal.transpose(2, 0, 1)[None], np.float32)


def resized(rgb: UInt8Array, size_px: tuple[int, int], resampling: int = 2) -> UInt8Array:
    """An image (h, w, 3) as (height, width, 3), smoothed where it shrinks."""
    if rgb.shape[:2] == size_px:
        return rgb
    height, width = size_px
    return np.asarray(Image.fromarray(rgb).resize((width, height), Image.Resampling(resampling)))


def middle(rgb: UInt8Array, size_px: tuple[int, int]) -> UInt8Array:
    """The middle (height, width) of an image, with black around it where that is larger."""
    height, width = size_px
    rows, columns = max(height - rgb.shape[0], 0), max(width - rgb.shape[1], 0)
    if rows or columns:
        before = (rows + 1) // 2, (columns + 1) // 2
        rgb = np.pad(rgb, ((before[0], rows - before[0]), (before[1], columns - before[1]), (0, 0)))
    top, left = (rgb.shape[0] - height) // 2, (rgb.shape[1] - width) // 2
    return rgb[top : top + height, left : left + width]


def shortest_edge_size(image_size: tuple[int, int], shortest_px: int, longest_px: int | None) -> tuple[int, int]:
    """(height, width) with the shorter side `shortest_px`, rounded as in DETR's `get_size_with_aspect_ratio`."""
    shorter, longer = min(image_size), max(image_size)
    wanted: float = shortest_px
    if longest_px is not None and longer / shorter * shortest_px > longest_px:
        wanted = longest_px * shorter / longer
    short = round(wanted)
    if shorter == short:
        return image_size
    sides = (short, max(int(wanted * longer / shorter), 1))
    return sides if image_size[0] <= image_size[1] else (sides[1], sides[0])


def read_image_format(folder: Path, default: ImageFormat, error_type: type[SupermapError]) -> ImageFormat:
    """The format that the configuration in a model's folder says, else the `default`.

    Raises an error of the type for a configuration that makes no sense.
    """
    given = read_settings(folder / CONFIGURATION, error_type)
    if not given:
        return default
    try:
        changes = {**_size(given.get("size")), **_values(given, default)}
        crop = given.get("crop_size") if given.get("do_center_crop") else None
        if isinstance(crop, Mapping):
            changes["crop_px"] = (_side(crop["height"]), _side(crop["width"]))
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise error_type(
            f"the model's image format is not understood: {type(error).__name__}: {error}",
            where=str(folder / CONFIGURATION),
            cure="get the file anew, or move it away: the family's own values are used without it",
        ) from error
    return replace(default, **changes)


def read_settings(path: Path, error_type: type[SupermapError]) -> Mapping[str, Any]:
    """The object in a JSON file beside a model; empty where there is no such file."""
    if not path.is_file():
        return {}
    try:
        value = json.loads(read_text(path, error_type, what="a JSON file"))
    except (ValueError, RecursionError) as error:
        raise error_type(f"no JSON: {error}", where=str(path), cure="get the file anew, or move it away") from error
    if not isinstance(value, dict):
        raise error_type("no JSON object", where=str(path), cure="get the file anew, or move it away")
    return value


def _size(size: object) -> dict[str, Any]:
    match size:
        case {"height": height, "width": width}:
            return {"size_px": (_side(height), _side(width))}
        case {"shortest_edge": shortest, **rest}:
            longest = rest.get("longest_edge")
            return {
                "size_px": None,
                "shortest_px": _side(shortest),
                "longest_px": None if longest is None else _side(longest),
            }
        case int():
            return {"size_px": (_side(size), _side(size))}
    return {}


def _values(given: Mapping[str, Any], default: ImageFormat) -> dict[str, Any]:
    """What is done to the values of pixels."""
    changes: dict[str, Any] = {}
    if "do_rescale" in given or "rescale_factor" in given:
        scale = float(given.get("rescale_factor", 1 / 255)) if given.get("do_rescale", True) else 1.0
        changes["scale"] = scale
    if given.get("do_normalize") is False:
        changes["mean"], changes["std"] = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    elif given.get("image_mean") is not None and given.get("image_std") is not None:
        changes["mean"], changes["std"] = _three(given["image_mean"]), _three(given["image_std"])
        if not all(changes["std"]):
            raise ValueError("image_std holds 0")
    if given.get("resample") is not None:
        changes["resampling"] = int(Image.Resampling(given["resample"]))
    numbers = [changes.get("scale", default.scale), *changes.get("mean", ()), *changes.get("std", ())]
    if not np.isfinite(numbers).all():
        raise ValueError("numbers that are not finite")
    return changes


def _three(values: Any) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _side(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= _LARGEST_SIDE_PX:
        raise ValueError(f"a size of {value!r} pixels")
    return value
