"""Files as recorders, crashes and people leave them."""

from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import CompressionMode

from support.foxglove_bags import Json, Protobuf
from zoo import damage
from zoo.foxglove import write_foxglove
from zoo.robot import Camera, Image, Motion, Robot, Variant
from zoo.shortcuts import rgbd

FRAME = "camera_color_optical_frame"
ROBOT = rgbd("/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw", FRAME)
FOXGLOVE = Robot(
    (Camera(Image("/camera/image", "camera_optical_frame"), Image("/camera/depth", "camera_optical_frame", "16UC1")),),
    motion=Motion(kind="tf"),
)
MCAP = "mcap.dev/spec"
ROSBAG2 = "github.com/ros2/rosbag2, README: storage, compression, splitting"
ROSBAG = "wiki.ros.org/rosbag/Commandline: record, reindex, compress; wiki.ros.org/Bags/Format/2.0"
LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a214614ab2935c943f9e0ff69d22e\nsize 100000\n"
SMALL_CHUNKS = {"chunk_size": 8192}


def of(name: str, source: str, suffix: str = ".mcap", **other: object) -> Variant:
    """The same robot in another file."""
    return Variant(name, ROBOT, source, suffix, **other)  # type: ignore[arg-type]


VARIANTS = (
    of("MCAP, zstd", MCAP, writer={"compression": CompressionType.ZSTD}),
    of("MCAP, lz4", MCAP, writer={"compression": CompressionType.LZ4}),
    of("MCAP without chunks", MCAP, writer={"use_chunking": False, "index_types": IndexType.NONE}),
    of(
        "MCAP without index and statistics",
        MCAP,
        writer={"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False},
    ),
    of("MCAP, cut off", MCAP, writer=SMALL_CHUNKS, damage=damage.cut(0.6), notes=("cut off",)),
    of(
        "MCAP, log times of zero at the start",
        MCAP,
        damage=damage.rewritten(lambda n, at, t: (0 if n < 8 else at, t)),
        notes=("time 0",),
    ),
    of(
        "MCAP, all log times zero",
        MCAP,
        damage=damage.rewritten(lambda n, at, t: (0, t)),
        notes=("off the time of recording",),
    ),
    of("MCAP, two-part type names", MCAP, damage=damage.rewritten(lambda n, at, t: (at, t.replace("/msg/", "/")))),
    of("MCAP without definitions", MCAP, writer={"definitions": False}),
    of("MCAP of a ROS 1 bag", "mcap.dev: mcap convert", ".bag", damage=damage.as_mcap),
    Variant("Foxglove JSON", FOXGLOVE, "docs.foxglove.dev/docs/sdk/schemas", write=write_foxglove(Json())),
    Variant("Foxglove protobuf", FOXGLOVE, "docs.foxglove.dev/docs/sdk/schemas", write=write_foxglove(Protobuf())),
    Variant(
        "Foxglove protobuf, JPEG",
        FOXGLOVE,
        "docs.foxglove.dev/docs/sdk/schemas",
        write=write_foxglove(Protobuf(), jpeg=True),
    ),
    of("rosbag2 folder", ROSBAG2, ""),
    of("rosbag2 folder without metadata.yaml", ROSBAG2, "", damage=damage.without_metadata),
    of("rosbag2, compressed by message", ROSBAG2, "", damage=damage.compressed(CompressionMode.MESSAGE)),
    of("rosbag2, compressed by file", ROSBAG2, "", damage=damage.compressed(CompressionMode.FILE)),
    of(
        "rosbag2, split, last part empty",
        ROSBAG2,
        damage=damage.in_folder("run_0.mcap", "run_1.mcap"),
        notes=("run_1.mcap",),
    ),
    of(
        "rosbag2, split, last part all zeros",
        ROSBAG2,
        ".db3",
        damage=damage.in_folder("run_0.db3", "run_1.db3", broken=bytes(4096)),
        notes=("run_1.db3",),
    ),
    of("db3 alone", ROSBAG2, ".db3"),
    of("db3 without definitions", ROSBAG2, ".db3", damage=damage.without_definitions),
    of("db3 with what is left in -wal", ROSBAG2, ".db3", damage=damage.with_wal),
    of("db3, cut off", ROSBAG2, ".db3", damage=damage.cut(0.9), notes=("damaged or cut off",)),
    of("ROS 1 bag", ROSBAG, ".bag"),
    of("ROS 1 bag that was not closed (.bag.active)", ROSBAG, ".bag", damage=damage.never_closed, notes=("all ",)),
    of("ROS 1 bag, cut off", ROSBAG, ".bag", damage=damage.cut(0.85), notes=("messages",)),
    of("any other name", ROSBAG2, damage=damage.renamed("monday.backup")),
    of(".mcap.zstd", ROSBAG2, damage=damage.zstd),
    of(".db3.zstd", ROSBAG2, ".db3", damage=damage.zstd),
    of(".bag.gz", ROSBAG, ".bag", damage=damage.gz),
    of(".bag.lz4", ROSBAG, ".bag", damage=damage.lz4_file),
    of(
        "zip archive",
        "RFC 1951; PKWARE APPNOTE",
        damage=damage.zipped,
        refused="a zip archive ({path}): unpack it with `unzip` and give the recording in it",
    ),
    of(
        "tar archive",
        "POSIX ustar",
        damage=damage.tarred,
        refused="a tar archive ({path}): unpack it with `tar -xf` and give the recording in it",
    ),
    of(
        "Git LFS pointer",
        "github.com/git-lfs/git-lfs, docs/spec.md",
        damage=damage.replaced(LFS),
        refused="a Git LFS pointer, not the recording itself ({path}): fetch the file with `git lfs pull`",
    ),
    of(
        "empty file",
        ROSBAG2,
        damage=damage.replaced(b""),
        refused="an empty file ({path}): record or copy it again, or name another file",
    ),
    of(
        "web page",
        "a download that asks to log in",
        damage=damage.replaced(b"<!DOCTYPE html><html></html>" * 20),
        refused="a web page ({path}): the download gave a page and not the file: download it again",
    ),
    of(
        "zeros, never written out",
        "a crash before the disk was flushed",
        damage=damage.replaced(bytes(9999)),
        refused="a file that begins with zeros, as one that was never written out ({path}): record or copy it again",
    ),
)
