"""The map as a 3D scene: binary glTF 2.0 (GLB), for Blender, MeshLab, three.js and other viewers.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html. Each instance is a node with its id as name, and in `extras`
its label, presence and times; its children are its box and its points. glTF is y up: the root node turns the map's z
up, so that Blender shows the map's own axes. Lengths are metres.
"""

from __future__ import annotations

import json
import math
import shutil
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from supermap_cli.drawing.colours import Rgb, colour_of
from supermap_cli.errors import ExportError
from supermap_cli.exporting.exported_instance import ExportedInstance
from supermap_cli.exporting.ply import occupied_voxels, state_offsets_m
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory.streaming import stream_geometry
from supermap_cli.version import __version__

_MAGIC, _VERSION, _JSON, _BIN = b"glTF", 2, 0x4E4F534A, 0x004E4942
_FLOAT, _USHORT = 5126, 5123
_VERTICES, _INDICES = 34962, 34963
_POINTS, _TRIANGLES = 0, 4
"""Constants of the specification: chunks; component types; targets of buffer views; modes of primitives."""
_MOST_BYTES = 2**32 - 1
_Z_UP = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""The quaternion x, y, z, w of a turn by -90 degrees about x: z becomes y."""
_BOX_ALPHA = {"present": 0.45}
_FAINT = 0.15
"""How opaque boxes are: what stands there, and what perhaps or no longer does."""


def _linear(value: int) -> float:
    """A channel of sRGB, 0 to 255, as linear light in [0, 1] (IEC 61966-2-1): glTF's factors are linear."""
    share = value / 255
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


_LINEAR_LIGHT = np.array([_linear(value) for value in range(256)], np.float32)
"""`_linear` of every value. Not rounded to 8 bits, where all dark colours would become one."""


@dataclass
class _Gltf:
    """A document as it grows, and the file of its binary chunk."""

    binary: IO[bytes]
    nodes: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    boxes: dict[tuple[Rgb, float], int] = field(default_factory=dict)
    cube: tuple[int, int, int] | None = None
    length: int = 0

    def accessor(self, values: NDArray[Any], kind: str, component: int, target: int, **more: Any) -> int:
        data = np.ascontiguousarray(values).tobytes()
        self.views.append({"buffer": 0, "byteOffset": self.length, "byteLength": len(data), "target": target})
        padded = data + b"\0" * (-len(data) % 4)
        self.binary.write(padded)
        self.length += len(padded)
        view = {"bufferView": len(self.views) - 1, "componentType": component, "count": len(values), "type": kind}
        self.accessors.append(view | more)
        return len(self.accessors) - 1

    def node(self, **values: Any) -> int:
        self.nodes.append(values)
        return len(self.nodes) - 1

    def box_mesh(self, rgb: Rgb, alpha: float) -> int:
        """A cube of edge 1 m about the origin; those of one colour share it."""
        if (rgb, alpha) not in self.boxes:
            if self.cube is None:
                positions, normals, indices = _cube()
                limits = {"min": [-0.5] * 3, "max": [0.5] * 3}
                self.cube = (
                    self.accessor(positions, "VEC3", _FLOAT, _VERTICES, **limits),
                    self.accessor(normals, "VEC3", _FLOAT, _VERTICES),
                    self.accessor(indices, "SCALAR", _USHORT, _INDICES),
                )
            linear = [_linear(value) for value in rgb]
            self.materials.append(
                {
                    "pbrMetallicRoughness": {"baseColorFactor": [*linear, alpha], "metallicFactor": 0.0},
                    "alphaMode": "BLEND",
                    "doubleSided": True,
                }
            )
            position, normal, index = self.cube
            primitive = {"attributes": {"POSITION": position, "NORMAL": normal}, "indices": index, "mode": _TRIANGLES}
            self.meshes.append({"primitives": [{**primitive, "material": len(self.materials) - 1}]})
            self.boxes[rgb, alpha] = len(self.meshes) - 1
        return self.boxes[rgb, alpha]

    def points_mesh(self, points: NDArray[np.float32], rgb: NDArray[np.uint8]) -> int:
        limits = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        position = self.accessor(points, "VEC3", _FLOAT, _VERTICES, **limits)
        colour = self.accessor(_LINEAR_LIGHT[rgb], "VEC3", _FLOAT, _VERTICES)
        self.meshes.append({"primitives": [{"attributes": {"POSITION": position, "COLOR_0": colour}, "mode": _POINTS}]})
        return len(self.meshes) - 1

    def document(self) -> dict[str, Any]:
        parts = {
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.length}] if self.length else [],
        }
        head = {"asset": {"version": "2.0", "generator": f"supermap-cli {__version__}"}}
        scene = {"scene": 0, "scenes": [{"nodes": [0]}]}
        return head | scene | {name: part for name, part in parts.items() if part}


def write_glb(source: ExportSource, path: Path, *, by_instance: bool = False) -> tuple[int, int]:
    """Write the scene; returns the numbers of boxes and points. `by_instance`: points in the colour of their instance.

    Raises `ExportError` for a map that needs more than the 4 GB which a GLB can hold.
    """
    with tempfile.TemporaryFile(dir=path.parent) as binary:
        gltf = _Gltf(binary)
        gltf.node(name="map", rotation=list(_Z_UP), children=[])
        boxes = points = 0
        for part in source.with_progress("objects", _instances(source, gltf, by_instance=by_instance)):
            boxes, points = boxes + part[0], points + part[1]
        if not gltf.nodes[0]["children"]:
            del gltf.nodes[0]["children"]
        document = json.dumps(gltf.document(), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        text = document.encode("utf-8", "replace")
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + (8 + gltf.length if gltf.length else 0)
        if length > _MOST_BYTES:
            raise ExportError("more than a GLB file can hold", where=str(path), cure="choose a part by --label, or ply")
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", _MAGIC, _VERSION, length) + struct.pack("<II", len(text), _JSON) + text)
            if gltf.length:
                file.write(struct.pack("<II", gltf.length, _BIN))
                binary.seek(0)
                shutil.copyfileobj(binary, file)
    return boxes, points


def _instances(source: ExportSource, gltf: _Gltf, *, by_instance: bool) -> Iterator[tuple[int, int]]:
    """Adds the instances; gives the numbers of boxes and points of each."""
    geometry = stream_geometry(source.reader)
    for instance in source.instances():  # both iterate in the order of numbers
        cloud = next(cloud for number, cloud in geometry if number == instance.number)
        voxels, rgb = occupied_voxels(cloud)
        if by_instance:
            rgb = np.broadcast_to(np.array(colour_of(instance.id), np.uint8), rgb.shape)
        mesh = gltf.points_mesh(voxels.astype(np.float32), rgb) if len(voxels) else None
        for state, offset_m in zip(instance.states, state_offsets_m(instance), strict=True):
            presence = instance.presence_in(state)
            box_mesh = gltf.box_mesh(colour_of(instance.label), _BOX_ALPHA.get(presence, _FAINT))
            half = float(state.box.yaw) / 2
            children = [
                gltf.node(
                    name=f"{instance.id} box",
                    mesh=box_mesh,
                    translation=state.box.center.tolist(),
                    rotation=[0.0, 0.0, math.sin(half), math.cos(half)],
                    scale=np.maximum(state.box.size, 1e-6).tolist(),
                )
            ]
            if mesh is not None:
                children.append(gltf.node(name=f"{instance.id} points", mesh=mesh, translation=offset_m.tolist()))
            name = instance.id if state.index == instance.newest.index else f"{instance.id}#{state.index}"
            gltf.nodes[0]["children"].append(
                gltf.node(name=name, children=children, extras=_extras(instance, presence))
            )
        yield len(instance.states), len(voxels) * len(instance.states)


def _extras(instance: ExportedInstance, presence: str) -> dict[str, object]:
    """Times as text: JSON readers in viewers keep 53 bits."""
    return {
        "id": instance.id,
        "label": instance.label,
        "presence": presence,
        "first_seen_ns": str(instance.first_seen_ns),
        "last_seen_ns": str(instance.last_seen_ns),
        "observations": instance.observations,
    }


def _cube() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint16]]:
    """Positions (24, 3), normals (24, 3) and indices (36,) of a cube: four corners a face, counter-clockwise."""
    positions: list[FloatArray] = []
    normals: list[FloatArray] = []
    indices: list[int] = []
    for axis in range(3):
        for side in (-0.5, 0.5):
            normal = np.zeros(3)
            normal[axis] = 2 * side
            u, v = np.roll(np.eye(3), axis, axis=1)[1:] if side > 0 else np.roll(np.eye(3), axis, axis=1)[:0:-1]
            start = len(positions)
            for a, b in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)):
                positions.append(normal / 2 + a * u + b * v)
                normals.append(normal)
            indices += [start, start + 1, start + 2, start, start + 2, start + 3]
    return np.array(positions, np.float32), np.array(normals, np.float32), np.array(indices, np.uint16)
