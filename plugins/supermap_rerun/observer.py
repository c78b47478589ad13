"""Tells Rerun what a mapping session sees and changes."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from zlib import crc32

import cv2
import numpy as np
import rerun as rr

from supermap_cli.geometry.arrays import FloatArray, UInt8Array
from supermap_cli.geometry.cameras import PinholeCamera, camera_from_json
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.types.detections import Detections, RegionMask, Tracks
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import (
    InstanceRecord,
    KeyframeRecord,
    MapDelta,
    Observation,
    SpatialEdge,
    StateRecord,
    TemporalEdge,
    VoxelCloud,
)
from supermap_cli.types.sensing import CameraFrame, Sweep
from supermap_cli.types.session import SessionContext, SessionSummary
from supermap_rerun import views
from supermap_rerun.streams import close_stream

_MM_PER_M = 1000.0
"""Stored depth is in millimetres."""
_BODY_M = (0.4, 0.3, 0.2)
"""m; the box that stands for a robot, half its size is of no meaning (chosen)."""
_SHOWN_WIDTH_PX = 320
"""px; images and masks are thinned to about this width: a viewer must not slow the build (chosen)."""
_JPEG_QUALITY = 80
"""Percent; of live images (chosen: a tenth of their size)."""
_MASK_OPACITY = 0.5
_POINTS_EVERY_NS = 2_000_000_000
"""ns; the points of a thing that changes are told no more often, for they are most of a map (chosen)."""
_PLANE_M = 0.3
"""m; how far before a camera its image stands in 3D (chosen)."""


class RerunObserver:
    """An observer that writes into a recording stream.

    Entities: `map/robot` (Transform3D) with its cameras below (Transform3D, `image` and `depth` with their Pinholes),
    `map/way`, `map/objects/NUMBER` (Boxes3D, and `points`), `relations` (GraphNodes, GraphEdges), `states/NUMBER`
    (StateChange), `changes` (TextLog). Labels are classes of one AnnotationContext.
    """

    def __init__(self, stream: rr.RecordingStream, target: str) -> None:
        """`target` is where the stream leads to, see `streams.stream_to`."""
        self._stream = stream
        self._target = target
        self._classes: dict[str, int] = {}
        self._ids: dict[int, str] = {}
        self._labels: dict[int, str] = {}
        self._open_edges: dict[tuple[int, str, int], None] = {}
        self._states: dict[tuple[int, int], tuple[bool, int | None]] = {}
        self._live: set[tuple[str, int]] = set()
        self._place: FloatArray | None = None
        self._now_ns = 0
        self._classes_told = 0
        self._points_told: dict[int, int] = {}
        self._points_waiting: dict[int, InstanceRecord] = {}

    def named(self, ids: Mapping[int, str]) -> None:
        """The text ids of instances, where they are known: a map gives them when it stores what was built."""
        self._ids |= ids

    def started(self, context: SessionContext) -> None:
        """The map's axes, and a line in the log."""
        self._stream.log(views.MAP, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._stream.log(f"{views.ROBOT}/body", rr.Boxes3D(sizes=[_BODY_M], labels=["robot"]), static=True)
        self._place = None
        self._stream.log(
            views.CHANGES,
            rr.TextLog(f"traversal {context.traversal} of {context.source}", level=rr.TextLogLevel.INFO),
            static=True,
        )

    def frame(self, frame: CameraFrame, T_map_base: FloatArray, sweep: Sweep | None) -> None:
        """The robot's pose and the sweep's points."""
        self._at(frame.stamp_ns)
        self._log_robot(T_map_base)
        if sweep is not None:
            points = transform_points(sweep.T_base_lidar, sweep.points_lidar)
            self._stream.log(f"{views.ROBOT}/sweep", rr.Points3D(points, radii=0.01))

    def perceived(
        self,
        keyframe: Keyframe,
        detections: Detections,
        masks: Sequence[RegionMask | None],
        tracks: Tracks,  # noqa: ARG002
    ) -> None:
        """The image with boxes, labels and masks."""
        self._at(keyframe.stamp_ns)
        base = f"{views.camera(keyframe.camera_id)}/image"
        step = max(1, keyframe.rgb.shape[1] // _SHOWN_WIDTH_PX)
        small = keyframe.rgb[::step, ::step]
        height, width = small.shape[:2]
        if isinstance(keyframe.camera, PinholeCamera):
            self._stream.log(base, _sampled_pinhole(keyframe.camera, step, plane_m=_PLANE_M))
        _, jpeg = cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        self._stream.log(base, rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))
        self._live.add((keyframe.camera_id, keyframe.stamp_ns))
        labels = [found[0].label for found in detections.hypotheses]
        ids = [self._class_of(label) for label in labels]
        self._log_classes()
        self._stream.log(f"{base}/boxes", _boxes_2d(detections.boxes_xyxy / step, ids, labels))
        classes = np.zeros((height, width), np.uint8 if len(self._classes) < 256 else np.uint16)
        for number, mask in zip(ids, masks, strict=True):
            if mask is not None:
                v, u = -(-mask.v0 // step), -(-mask.u0 // step)
                part = mask.pixels[v * step - mask.v0 :: step, u * step - mask.u0 :: step]
                classes[v : v + part.shape[0], u : u + part.shape[1]][part] = number
        self._stream.log(f"{base}/masks", rr.SegmentationImage(classes, opacity=_MASK_OPACITY))

    def mapped(self, keyframe: KeyframeRecord | None, delta: MapDelta) -> None:
        """What a keyframe changed; at last without one, at the time of the one before."""
        if keyframe is not None:
            self._at(keyframe.stamp_ns)
            self._log_keyframe(keyframe, delta.observations)
        for instance in delta.instances:
            self._labels[instance.number] = instance.label
            self._log_instance(instance)
        self._log_classes()
        for state in delta.states:
            self._log_state(state)
        for edge in delta.spatial_edges:
            self._keep_edge(edge)
        if delta.spatial_edges:
            self._log_relations()
        for change in delta.temporal_edges:
            self._log_change(change)
        if keyframe is not None:
            self._at(keyframe.stamp_ns)

    def committed(self, batch: MapDelta) -> None:
        """Nothing: it was told when it was mapped."""

    def ended(self, summary: SessionSummary) -> None:
        """A line in the log; what waits is written out."""
        for instance in list(self._points_waiting.values()):
            self._log_points(instance)
        what = "complete" if summary.complete else "stopped"
        text = f"{what}: {summary.keyframes} keyframes, {summary.observations} observations, {summary.objects} objects"
        self._stream.log(views.CHANGES, rr.TextLog(text, level=rr.TextLogLevel.INFO))
        self._stream.flush()

    def close(self) -> None:
        """Nothing more comes: a file is complete."""
        close_stream(self._target)

    # -- parts

    def _at(self, stamp_ns: int) -> None:
        self._now_ns = stamp_ns
        self._stream.set_time(views.TIMELINE, timestamp=np.datetime64(stamp_ns, "ns"))

    def _log_robot(self, T_map_base: FloatArray) -> None:
        self._stream.log(views.ROBOT, _transform(T_map_base))
        place = T_map_base[:3, 3].copy()
        if self._place is not None:
            self._stream.log(views.WAY, rr.LineStrips3D([np.stack([self._place, place])], radii=0.015))
        self._place = place

    def _log_keyframe(self, keyframe: KeyframeRecord, observations: Sequence[Observation]) -> None:
        self._log_robot(keyframe.T_map_base)
        path = views.camera(keyframe.camera_id)
        self._stream.log(path, _transform(inverse(keyframe.T_map_base) @ keyframe.T_map_camera))
        camera = camera_from_json(keyframe.camera)
        if isinstance(camera, PinholeCamera):
            self._stream.log(f"{path}/depth", _sampled_pinhole(camera, keyframe.depth_step))
            depth = rr.EncodedDepthImage(keyframe.depth_png, media_type="image/png", meter=_MM_PER_M)
            self._stream.log(f"{path}/depth", depth)
        if keyframe.thumbnail_jpeg is None or (keyframe.camera_id, keyframe.stamp_ns) in self._live:
            return
        image = cv2.imdecode(np.frombuffer(keyframe.thumbnail_jpeg, np.uint8), cv2.IMREAD_COLOR)
        if image is None:
            return
        height, width = image.shape[:2]
        if isinstance(camera, PinholeCamera):
            self._stream.log(f"{path}/image", _pinhole(camera, width, height))
        self._stream.log(f"{path}/image", rr.EncodedImage(contents=keyframe.thumbnail_jpeg, media_type="image/jpeg"))
        scale = width / camera.width
        seen = [found for found in observations if found.camera_id == keyframe.camera_id]
        labels = [found.hypotheses[0].label for found in seen]
        ids = [self._class_of(label) for label in labels]
        boxes = np.array([found.box_xyxy for found in seen], np.float32).reshape(-1, 4)
        names = [self._name(found.object_number) for found in seen]
        self._stream.log(f"{path}/image/boxes", _boxes_2d((boxes + 0.5) * scale - 0.5, ids, names))

    def _log_instance(self, instance: InstanceRecord) -> None:
        path, number = views.thing(instance.number), self._class_of(instance.label)
        if instance.presence != "present" or instance.merged_into is not None:
            self._stream.log(path, rr.Clear(recursive=True))
            self._points_told.pop(instance.number, None)
            self._points_waiting.pop(instance.number, None)
            return
        box, half = instance.box, float(instance.box.yaw) / 2
        turned = rr.Quaternion(xyzw=[0.0, 0.0, np.sin(half), np.cos(half)])
        self._stream.log(
            path,
            rr.Boxes3D(
                centers=[box.center],
                sizes=[box.size],
                quaternions=[turned],
                class_ids=[number],
                labels=[self._name(instance.number)],
            ),
        )
        told_ns = self._points_told.get(instance.number)
        if told_ns is None or self._now_ns - told_ns >= _POINTS_EVERY_NS:
            self._log_points(instance)
        else:
            self._points_waiting[instance.number] = instance

    def _log_points(self, instance: InstanceRecord) -> None:
        self._points_told[instance.number] = self._now_ns
        self._points_waiting.pop(instance.number, None)
        centers, rgb = _solid(instance.voxels)
        points = rr.Points3D(centers, colors=rgb, radii=instance.voxels.voxel_m / 2)
        self._stream.log(f"{views.thing(instance.number)}/points", points)

    def _log_state(self, state: StateRecord) -> None:
        """Lanes of presence: when it was not there yet, since when it is, when nobody can say, when it was gone."""
        key, known = (state.object_number, state.index), (True, state.gone_ns)
        before = self._states.get(key)
        if before == known:
            return
        path = f"{views.STATES}/{state.object_number}"
        if before is None:
            if state.empty_before_ns is not None:
                self._log_lane(path, state.empty_before_ns, "nobody can say")
            self._log_lane(path, state.first_seen_ns, "present")
        if state.gone_ns is not None:
            self._log_lane(path, state.last_seen_ns + 1, "nobody can say")
            self._log_lane(path, state.gone_ns, "gone")
        self._states[key] = known

    def _log_lane(self, path: str, stamp_ns: int, state: str) -> None:
        self._at(stamp_ns)
        self._stream.log(path, rr.StateChange(state=state))

    def _keep_edge(self, edge: SpatialEdge) -> None:
        key = (edge.subject, edge.relation, edge.object)
        if edge.until_ns is None:
            self._open_edges[key] = None
        else:
            self._open_edges.pop(key, None)

    def _log_relations(self) -> None:
        numbers = sorted({number for subject, _, other in self._open_edges for number in (subject, other)})
        names = [self._name(number) for number in numbers]
        pairs = sorted({(str(subject), str(other)) for subject, _, other in self._open_edges})
        self._stream.log(views.RELATIONS, rr.GraphNodes([str(number) for number in numbers], labels=names))
        self._stream.log(views.RELATIONS, rr.GraphEdges(pairs, graph_type="directed"))

    def _log_change(self, change: TemporalEdge) -> None:
        self._at(change.not_after_ns)
        first, second = self._name(change.from_number), self._name(change.to_number)
        text = f"{first} {change.kind}" if change.from_number == change.to_number else f"{first} {change.kind} {second}"
        if change.distance_m is not None:
            text += f" {change.distance_m:.2f} m"
        self._stream.log(views.CHANGES, rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def _name(self, number: int) -> str:
        """The text id; before a map has given one, label and number."""
        return self._ids.get(number) or f"{self._labels.get(number, 'object')} ({number})"

    def _class_of(self, label: str) -> int:
        """A number from 1 on; 0 is what belongs to none."""
        return self._classes.setdefault(label, len(self._classes) + 1)

    def _log_classes(self) -> None:
        if len(self._classes) != self._classes_told:
            self._classes_told = len(self._classes)
            infos = [rr.AnnotationInfo(id=0, color=(0, 0, 0, 0))]
            infos += [
                rr.AnnotationInfo(id=number, label=label, color=_colour(label))
                for label, number in self._classes.items()
            ]
            self._stream.log("/", rr.AnnotationContext(infos), static=True)


def _transform(T: FloatArray) -> rr.Transform3D:
    return rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3])


def _sampled_pinhole(camera: PinholeCamera, step_px: int, plane_m: float | None = None) -> rr.Pinhole:
    """The camera of an image of every `step_px`-th pixel in u and v."""
    K = np.diag([camera.fx / step_px, camera.fy / step_px, 1.0])
    K[:2, 2] = camera.cx / step_px + 0.5, camera.cy / step_px + 0.5
    size = [-(-camera.width // step_px), -(-camera.height // step_px)]
    return rr.Pinhole(
        image_from_camera=K, resolution=size, camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=plane_m
    )


def _pinhole(camera: PinholeCamera, width: int, height: int) -> rr.Pinhole:
    """The camera for an image of another size; Rerun's images begin at the corner of a pixel, ours at its centre."""
    scale_u, scale_v = width / camera.width, height / camera.height
    K = np.array(
        [
            [camera.fx * scale_u, 0, (camera.cx + 0.5) * scale_u],
            [0, camera.fy * scale_v, (camera.cy + 0.5) * scale_v],
            [0, 0, 1],
        ]
    )
    return rr.Pinhole(
        image_from_camera=K,
        resolution=[width, height],
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=_PLANE_M,
    )


def _boxes_2d(boxes_xyxy: FloatArray, ids: list[int], labels: list[str]) -> rr.Boxes2D:
    return rr.Boxes2D(array=boxes_xyxy, array_format=rr.Box2DFormat.XYXY, class_ids=ids, labels=labels)


def _solid(voxels: VoxelCloud) -> tuple[FloatArray, UInt8Array]:
    """(n, 3) centres in metres and (n, 3) colours of the voxels that are rather occupied; of all, if none is."""
    occupied = voxels.log_odds > 0
    chosen = occupied if occupied.any() else np.ones(len(voxels), bool)
    centers: FloatArray = (voxels.keys[chosen].astype(np.float64) + 0.5) * voxels.voxel_m
    return centers, voxels.rgb[chosen]


def _colour(label: str) -> tuple[int, int, int]:
    """A colour of a label, the same in every recording."""
    code = crc32(label.encode("utf-8", "surrogatepass"))
    red, green, blue = colorsys.hsv_to_rgb(code % 360 / 360, 0.7 + code // 360 % 3 / 10, 0.85)
    return round(255 * red), round(255 * green), round(255 * blue)
