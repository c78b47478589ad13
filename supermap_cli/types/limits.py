"""Bounds on what is read into memory, and on times and places that are reckoned with."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

LARGEST_STAMP_NS = 1 << 62
"""ns; no clock shows more (the year 2116), no written time lies beyond, and sums of two such stamps fit into int64."""

LARGEST_CLOCK_OFFSET_S = float(1 << 31)
"""s by which a clock may be set right: from one that counts from its start to Unix time (31 bits until 2038)."""

FARTHEST_M = 1e4
"""Metres; no place is written farther from where a map begins. Voxels of 5 cm are counted up to 52 km, and covariances
keep their digits (measured: they lose them between 10 and 49 km).
"""


LARGEST_LIMIT = 1 << 50
"""The largest limit that may be set: of bytes, 1 PiB."""

Amount = Annotated[int, Field(gt=0, le=LARGEST_LIMIT)]
"""How much of something."""


LATEST_S = 4e9
"""s from the first message beyond which nothing of a recording is looked for: more than from 1970, where clocks begin
that were never set, until today; as ns it fits into int64 together with a stamp.
"""


class RecordingLimits(BaseModel):
    """How much a recording may hold of anything that comes out of its bytes: what is beyond it is left out, so that a
    small damaged or hostile file cannot take the machine's memory. Set far beyond what sensors give (estimates).
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    file_bytes: Amount = Field(default=1 << 40, description="of a file compressed as a whole, unpacked (1 TiB)")
    chunk_bytes: Amount = Field(default=1 << 30, description="of a chunk or a compressed message, unpacked (1 GiB)")
    message_bytes: Amount = Field(default=1 << 28, description="of one message (256 MiB)")
    structure_bytes: Amount = Field(
        default=1 << 23, description="of one message that is neither an image nor a cloud (8 MiB)"
    )
    image_pixels: Amount = Field(default=1 << 26, description="of one image (64 megapixels)")
    cloud_points: Amount = Field(default=1 << 23, description="of one point cloud (8 million)")
    string_bytes: Amount = Field(default=1 << 16, description="of a label (64 KiB)")
    list_items: Amount = Field(default=1 << 16, description="detections in one message, items of a fixed array")
    nesting: Amount = Field(default=64, description="levels of messages within messages")
    topics: Amount = Field(default=1 << 16, description="topics of one recording")
