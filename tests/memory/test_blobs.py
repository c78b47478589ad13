"""The binary formats survive a round trip, and damage is noticed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import blobs
from supermap_cli.types.memory import VoxelCloud


@st.composite
def clouds(draw: st.DrawFn) -> VoxelCloud:
    n = draw(st.integers(0, 20))
    reals = npst.arrays(np.float32, n, elements=st.floats(-100, 100, width=32))
    return VoxelCloud(
        draw(st.floats(0.001, 1.0)),
        draw(npst.arrays(np.int32, (n, 3))),
        draw(reals),
        draw(reals),
        draw(reals),
        draw(npst.arrays(np.uint8, (n, 3))),
    )


@given(clouds())
def test_voxels_survive_the_round_trip(cloud: VoxelCloud) -> None:
    decoded = blobs.decode_voxels(blobs.encode_voxels(cloud))

    assert decoded.voxel_m == cloud.voxel_m
    for name in ("keys", "log_odds", "inside", "outside", "rgb"):
        before, after = getattr(cloud, name), getattr(decoded, name)
        assert after.dtype == before.dtype
        np.testing.assert_array_equal(after, before)


@given(npst.arrays(np.float32, st.integers(0, 16), elements=st.floats(-1, 1, width=32)))
def test_embeddings_survive_the_round_trip(embedding: np.ndarray) -> None:
    np.testing.assert_array_equal(blobs.decode_embedding(blobs.encode_embedding(embedding)), embedding)


@pytest.mark.parametrize("blob", [b"", b"PNG.", b"SMV1", b"SMV1not zlib"])
def test_damaged_voxels_are_an_error(blob: bytes) -> None:
    with pytest.raises(MemoryStoreError, match="voxel blob"):
        blobs.decode_voxels(blob)


def test_a_truncated_embedding_is_an_error() -> None:
    with pytest.raises(MemoryStoreError, match="embedding"):
        blobs.decode_embedding(b"\x00\x00\x80")
