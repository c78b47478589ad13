"""Masks for boxes that came without, from the depth image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Recording, Segmenter


class DepthSegmenterOptions(Options):
    """Options of the segmenter `depth`; the default of `samples` bounds the time for a box. Chosen."""

    samples: int = Field(
        default=6_000, ge=400, description="depth pixels looked at for each box; large boxes are sampled to that many"
    )


@hookimpl
def register_segmenters(register: Register) -> None:
    """The segmenter `depth`."""
    register("depth", _make_segmenter, DepthSegmenterOptions)


def _make_segmenter(options: DepthSegmenterOptions, recording: Recording) -> Segmenter:  # noqa: ARG001 - it needs none
    from supermap_depth_segmenter.segmenter import DepthSegmenter  # noqa: PLC0415 - loads cv2 and scipy

    return DepthSegmenter(options)
