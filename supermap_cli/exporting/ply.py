"""The map as a point cloud (PLY): the occupied voxels of objects, with instance and label.

Header comments give the meaning of instance and label numbers:

    comment instance 7 chair-7 label 0
    comment label 0 chair

and as of a time, the presence of each instance:

    comment instance 7 is unknown: left between 10:21:03 and 10:22:40; nobody can say for 10:22:00
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from supermap_cli.drawing.colours import colour_of
from supermap_cli.exporting.exported_instance import ExportedInstance
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.voxel_map import voxel_map_from_cloud
from supermap_cli.memory.streaming import stream_geometry
from supermap_cli.query.presence_at import describe_presence
from supermap_cli.types.memory import VoxelCloud

VERTEX = np.dtype(
    [
        *((axis, "<f4") for axis in "xyz"),
        *((channel, "u1") for channel in ("red", "green", "blue")),
        *(("instance", "<i4"), ("label", "<i4"), ("voxel_size", "<f4")),
    ]
)
_PLY_TYPES = {"<f4": "float", "|u1": "uchar", "<i4": "int"}
_COUNT_DIGITS = 12
"""Width of the vertex count, which is known last and written into the reserved space."""


def write_ply(source: ExportSource, path: Path, *, ascii_text: bool = False, by_instance: bool = False) -> int:
    """Write the cloud and return its number of points. `by_instance`: in the colour of their instance, not as seen.

    The map stores an instance's shape in its newest place. For an earlier state it is shifted by the offset between the
    two centroids, which a comment tells.
    """
    with path.open("wb") as file:
        file.write(b"ply\nformat %s 1.0\n" % (b"ascii" if ascii_text else b"binary_little_endian"))
        _comment(file, "SuperMap memory, frame map: metres, z up; a point is the centre of a cube of voxel_size")
        labels = _write_comments(source, file)
        file.write(b"element vertex ")
        count_at = file.tell()
        file.write(b"0" * _COUNT_DIGITS + b"\n")
        for name in VERTEX.names or ():
            file.write(f"property {_PLY_TYPES[VERTEX[name].str]} {name}\n".encode())
        file.write(b"end_header\n")
        count = 0
        for vertices in source.with_progress("objects", _vertices(source, labels, by_instance=by_instance)):
            file.write(_as_text(vertices) if ascii_text else vertices.tobytes())
            count += len(vertices)
        file.seek(count_at)
        file.write(f"{count:0{_COUNT_DIGITS}d}".encode())
    return count


def _write_comments(source: ExportSource, file: BinaryIO) -> dict[int, int]:
    """Write the comments; returns the label index of each instance."""
    labels: dict[str, int] = {}
    label_of_instance: dict[int, int] = {}
    for instance in source.instances():
        label = label_of_instance[instance.number] = labels.setdefault(instance.label, len(labels))
        _comment(file, f"instance {instance.number} {instance.id} label {label}")
        if instance.presence_then is not None and source.selection.at is not None:
            why = describe_presence(instance.presence_then, source.selection.at.at_ns, source.clock)
            _comment(file, f"instance {instance.number} is {instance.presence}: {why}")
        for state, offset_m in zip(instance.states, state_offsets_m(instance), strict=True):
            if offset_m.any():
                moved = " ".join(f"{value:.4f}" for value in offset_m)
                _comment(file, f"instance {instance.number} state {state.index} is its newest shape shifted by {moved}")
    for name, label in labels.items():
        _comment(file, f"label {label} {name}")
    return label_of_instance


def state_offsets_m(instance: ExportedInstance) -> list[FloatArray]:
    """The offset (3,) of each state's centroid from the newest one, metres."""
    return [state.centroid_map - instance.newest.centroid_map for state in instance.states]


def _vertices(source: ExportSource, labels: dict[int, int], *, by_instance: bool) -> Iterator[NDArray[np.void]]:
    geometry = stream_geometry(source.reader)
    for instance in source.instances(named=False):  # both iterate in the order of numbers
        cloud = next(cloud for number, cloud in geometry if number == instance.number)
        points, rgb = occupied_voxels(cloud)
        if by_instance:
            rgb = np.broadcast_to(np.array(colour_of(instance.id), np.uint8), rgb.shape)
        for offset_m in state_offsets_m(instance):
            vertices = np.empty(len(points), VERTEX)
            for axis, values in zip("xyz", (points + offset_m).T, strict=True):
                vertices[axis] = values
            for channel, values in zip(("red", "green", "blue"), rgb.T, strict=True):
                vertices[channel] = values
            vertices["instance"], vertices["label"] = instance.number, labels[instance.number]
            vertices["voxel_size"] = cloud.voxel_m
            yield vertices


def occupied_voxels(cloud: VoxelCloud) -> tuple[FloatArray, NDArray[np.uint8]]:
    """(n, 3) centres (metres) and (n, 3) colours of the solid voxels; of all voxels if none is solid."""
    voxels = voxel_map_from_cloud(cloud)
    solid = voxels.solid()
    occupied = solid if solid.any() else np.ones(len(voxels), dtype=bool)
    return voxels.centers()[occupied], np.clip(np.round(voxels.rgb[occupied]), 0, 255).astype(np.uint8)


def _as_text(vertices: NDArray[np.void]) -> bytes:
    lines = (
        f"{x:.4f} {y:.4f} {z:.4f} {red} {green} {blue} {instance} {label} {voxel_m:.6g}\n"
        for x, y, z, red, green, blue, instance, label, voxel_m in vertices.tolist()
    )
    return "".join(lines).encode()


def _comment(file: BinaryIO, text: str) -> None:
    """Write one comment line; a label may contain any text."""
    line = " ".join(text.split())
    file.write(b"comment " + line.encode("ascii", "backslashreplace") + b"\n")
