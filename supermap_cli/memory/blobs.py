"""The formats of the database's binary columns. All numbers are little-endian.

**Voxels** (`instance.voxels`): the four bytes ``SMV1``, then a zlib stream of

    float64       voxel_m, the edge in metres
    uint32        n
    int32   n*3   keys, x y z of one voxel after the other; a centre lies at (key + 0.5) * voxel_m in the map frame
    float32 n     occupancy log-odds
    float32 n     how often seen inside the object's masks
    float32 n     how often seen beside them
    uint8   n*3   red, green, blue

**Embeddings** (`instance.embedding`): float32 d, unit length.

**Images**: `keyframe.depth_png` is a 16-bit PNG in millimetres (0 = no return), `keyframe.thumbnail_jpeg` and
`observation.crop_jpeg` are JPEG, each as in a file of its kind.

**Checkpoints** (`checkpoint.content`) are packed values, see `supermap_cli.types.packing`.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.types.memory import VoxelCloud

VOXEL_MAGIC = b"SMV1"
_HEADER = struct.Struct("<dI")
_BYTES_PER_VOXEL = 3 * 4 + 3 * 4 + 3
_FAST = 1
MAX_VOXELS = 5_000_000
"""Of one thing; a hall of 50 m x 50 m x 10 m has fewer in voxels of 5 cm. A blob of 2 MB could else become 2 GB."""


_GREATEST_EDGE_M = 1000.0
"""Metres; no voxel is larger."""


def encode_voxels(cloud: VoxelCloud) -> bytes:
    """Pack a voxel cloud."""
    columns = (
        cloud.keys.astype("<i4"),
        cloud.log_odds.astype("<f4"),
        cloud.inside.astype("<f4"),
        cloud.outside.astype("<f4"),
        cloud.rgb.astype("u1"),
    )
    payload = _HEADER.pack(cloud.voxel_m, len(cloud)) + b"".join(column.tobytes() for column in columns)
    return VOXEL_MAGIC + zlib.compress(payload, _FAST)


def decode_voxels(blob: bytes) -> VoxelCloud:
    """Unpack a voxel cloud. Raises `MemoryStoreError` for anything else."""
    if not blob.startswith(VOXEL_MAGIC):
        raise MemoryStoreError("a voxel blob does not start with SMV1", cure="run `supermap db check`")
    try:
        payload = _inflated(blob[len(VOXEL_MAGIC) :])
        voxel_m, n = _HEADER.unpack_from(payload)
    except (zlib.error, struct.error) as error:
        raise MemoryStoreError(f"a voxel blob is damaged: {error}", cure="run `supermap db check`") from error
    if len(payload) != _HEADER.size + n * _BYTES_PER_VOXEL:
        raise MemoryStoreError(f"a voxel blob of {n} voxels has {len(payload)} bytes", cure="run `supermap db check`")
    if not 0 < voxel_m < _GREATEST_EDGE_M:
        raise MemoryStoreError(f"a voxel blob has an edge of {voxel_m} m", cure="run `supermap db check`")
    at = _HEADER.size
    keys = np.frombuffer(payload, "<i4", 3 * n, at).reshape(n, 3)
    reals = np.frombuffer(payload, "<f4", 3 * n, at + 12 * n).reshape(3, n).astype(np.float32)
    rgb = np.frombuffer(payload, "u1", 3 * n, at + 24 * n).reshape(n, 3)
    return VoxelCloud(voxel_m, keys.astype(np.int32), reals[0], reals[1], reals[2], rgb.copy())


def _inflated(content: bytes) -> bytes:
    inflating = zlib.decompressobj()
    payload = inflating.decompress(content, _HEADER.size + MAX_VOXELS * _BYTES_PER_VOXEL)
    if inflating.unconsumed_tail or not inflating.eof:
        raise zlib.error("it ends too early, or has too many voxels")
    return payload


def encode_embedding(embedding: Float32Array) -> bytes:
    """Pack an embedding (d,)."""
    return embedding.astype("<f4").tobytes()


def decode_embedding(blob: bytes) -> Float32Array:
    """Unpack an embedding (d,). Raises `MemoryStoreError` where the bytes are no whole number of floats."""
    if len(blob) % 4:
        raise MemoryStoreError(f"an embedding blob has {len(blob)} bytes", cure="run `supermap db check`")
    return np.frombuffer(blob, "<f4").astype(np.float32)
