"""Shortcuts for the tables: a colour camera with depth in one line."""

from __future__ import annotations

from zoo.robot import Camera, Cloud, Found, Image, Imu, Motion, Robot

Beside = Image | Cloud | Motion | Imu | Found


def color(topic: str, frame: str, encoding: str = "rgb8", **other: object) -> Image:
    """A colour image."""
    return Image(topic, frame, encoding, **other)  # type: ignore[arg-type]


def depth(topic: str, frame: str, encoding: str = "16UC1", **other: object) -> Image:
    """A depth image."""
    return Image(topic, frame, encoding, content="depth", **other)  # type: ignore[arg-type]


def rgbd(
    color_topic: str,
    depth_topic: str,
    frame: str,
    *,
    encoding: str = "rgb8",
    depth_encoding: str = "16UC1",
    depth_frame: str | None = None,
    body: str = "",
    depth_info: str = "beside",
    info: str = "beside",
    model: str = "plumb_bob",
    distortion: tuple[float, ...] = (),
    others: tuple[Beside, ...] = (),
    offset: tuple[float, float, float] = (0, 0, 0),
    depth_size: tuple[int, int] | None = None,
    **robot: object,
) -> Robot:
    """A robot with one camera, depth in the colour's frame unless it has its own."""
    image = Image(color_topic, frame, encoding, info=info, model=model, distortion=distortion)
    sized = {} if depth_size is None else {"size": depth_size}
    behind = Image(
        depth_topic,
        frame if depth_frame is None else depth_frame,
        depth_encoding,
        content="depth",
        info=depth_info,
        model=model,
        distortion=distortion,
        offset=offset,
        **sized,
    )
    return Robot((Camera(image, behind, body),), others=others, **robot)  # type: ignore[arg-type]
