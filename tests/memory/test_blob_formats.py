"""The binary columns are what docs/internals-database.md says: decoded here from that text alone."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.types.packing import pack
from support import databases
from support import synthetic_room as room
from support.cli import supermap


class Voxels(NamedTuple):
    """`instance.voxels`: ``SMV1``, then a zlib stream of voxel_m (float64), n (uint32), keys (int32, n x 3), log-odds,
    seen inside, seen beside (float32, n each), colour (uint8, n x 3).
    """

    voxel_m: float
    keys: np.ndarray
    log_odds: np.ndarray
    inside: np.ndarray
    beside: np.ndarray
    rgb: np.ndarray

    @property
    def centres(self) -> FloatArray:
        """A centre lies at (key + 0.5) * voxel_m."""
        return np.asarray((self.keys + 0.5) * self.voxel_m)


def voxels(blob: bytes) -> Voxels:
    assert blob[:4] == b"SMV1"
    stream = zlib.decompress(blob[4:])
    voxel_m, n = struct.unpack_from("<dI", stream)
    rest = stream[12:]
    assert len(rest) == n * (12 + 12 + 3)
    keys = np.array(struct.unpack_from(f"<{3 * n}i", rest)).reshape(n, 3)
    columns = np.array(struct.unpack_from(f"<{3 * n}f", rest, 12 * n)).reshape(3, n)
    rgb = np.array(struct.unpack_from(f"<{3 * n}B", rest, 24 * n)).reshape(n, 3)
    return Voxels(voxel_m, keys, *columns, rgb)


def chunks(png: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of a PNG's chunks, their checksums verified (W3C PNG, section 5)."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    at = 8
    while at < len(png):
        (length,) = struct.unpack_from(">I", png, at)
        kind, content = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length) == (zlib.crc32(kind + content),)
        yield kind, content
        at += 12 + length


def depth_mm(png: bytes) -> np.ndarray:
    """A 16-bit greyscale PNG (h, w) with its filters undone (W3C PNG, section 9)."""
    parts = list(chunks(png))
    width, _, depth, colour, *_, interlaced = struct.unpack(">IIBBBBB", parts[0][1])
    assert (parts[0][0], depth, colour, interlaced) == (b"IHDR", 16, 0, 0)
    rows = zlib.decompress(b"".join(content for kind, content in parts if kind == b"IDAT"))
    above, image = bytearray(2 * width), []
    for start in range(0, len(rows), 2 * width + 1):
        kind, row = rows[start], bytearray(rows[start + 1 : start + 1 + 2 * width])
        for i in range(2 * width):
            left, up, corner = (row[i - 2], above[i], above[i - 2]) if i >= 2 else (0, above[i], 0)
            guess = left + up - corner
            nearest = min((left, up, corner), key=lambda neighbour: abs(guess - neighbour))
            row[i] = (row[i] + (0, left, up, (left + up) // 2, nearest)[kind]) % 256
        image.append(np.frombuffer(bytes(row), ">u2"))
        above = row
    return np.array(image)


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map that a real build made."""
    folder = tmp_path_factory.mktemp("room")
    room.write_room_recording(folder / "room.mcap", seconds=3.0)
    result = supermap("build", folder / "room.mcap", "--db", folder / "map.db")
    assert result.exit_code == 0, result.output
    return folder / "map.db"


def rows(db: Path, sql: str) -> list[tuple]:
    with closing(databases.connect(db)) as connection:
        return list(connection.execute(sql).fetchall())


def test_voxels_are_where_the_object_is(db: Path) -> None:
    found = rows(db, "SELECT voxels, center_x, center_y, center_z, size_x, size_y, size_z FROM instance")
    assert found
    for blob, *box in found:
        decoded = voxels(blob)
        centre, reach_m = np.array(box[:3]), np.linalg.norm(box[3:]) / 2 + 2 * decoded.voxel_m
        solid = (decoded.log_odds > 0) & (decoded.inside > decoded.beside)
        distance_m = np.linalg.norm(decoded.centres[solid] - centre, axis=1)
        assert np.mean(distance_m < reach_m) > 0.9
        assert decoded.rgb.max() <= 255
        assert np.isfinite(decoded.log_odds).all()


def test_a_depth_image_is_millimetres_of_every_so_manyth_pixel(db: Path) -> None:
    ((png, step, camera),) = rows(db, "SELECT depth_png, depth_step, camera FROM keyframe ORDER BY id LIMIT 1")
    decoded = depth_mm(png)
    np.testing.assert_array_equal(decoded, cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED))
    measured = decoded[decoded > 0]
    assert 300 < np.median(measured) < 10_000
    told = json.loads(camera)
    assert decoded.shape == (-(-told["height"] // step), -(-told["width"] // step))


def test_pictures_are_jpeg(db: Path) -> None:
    pictures = rows(db, "SELECT thumbnail_jpeg FROM keyframe WHERE thumbnail_jpeg IS NOT NULL")
    pictures += rows(db, "SELECT crop_jpeg FROM observation WHERE crop_jpeg IS NOT NULL")
    assert len(pictures) > 3
    for (picture,) in pictures:
        assert (picture[:3], picture[-2:]) == (b"\xff\xd8\xff", b"\xff\xd9")
        assert cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR) is not None


def test_a_checkpoint_is_json_and_the_arrays_that_it_speaks_of() -> None:
    packed = pack({"stamp_ns": 5, "poses": np.arange(6.0).reshape(2, 3), "keys": np.array([7], np.int32)}, {})
    assert packed[:4] == b"SMC1"
    stream = zlib.decompress(packed[4:])
    (n,) = struct.unpack_from("<I", stream)
    arrays = stream[4 + n :]
    told = dict(json.loads(stream[4 : 4 + n])["dict"])
    assert told["stamp_ns"] == 5
    for name, values in (("poses", (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)), ("keys", (7,))):
        (start, length), dtype = told[name]["array"], told[name]["dtype"]
        kind = {"<f8": "d", "<i4": "i"}[dtype]
        assert struct.unpack(f"<{len(values)}{kind}", arrays[start : start + length]) == values
    assert told["poses"]["shape"] == [2, 3]


@pytest.mark.sqlite_only("asks SQLite's catalogue; the columns are the same everywhere")
def test_there_is_no_other_binary_column(db: Path) -> None:
    found = rows(
        db,
        "SELECT t.name || '.' || c.name FROM sqlite_master t JOIN pragma_table_info(t.name) c "
        "WHERE t.type = 'table' AND c.type = 'BLOB' AND t.sql NOT LIKE '%VIRTUAL%'",
    )
    documented = (Path(__file__).parents[2] / "docs" / "internals-database.md").read_text(encoding="utf-8")
    ours = {name for (name,) in found if not name.startswith(("state_box", "instance_label", "sqlite"))}
    assert {name for name in ours if f"`{name}`" not in documented} == set()
