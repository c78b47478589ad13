"""A small kitchen in which things happen: two traversals, for tests of questions.

Monday (0-100 s): table-1 with cup-1 on it, chair-1 near the table, chair-2 near tv-1, potted-plant-1, book-1.
Tuesday (1000-1100 s): cup-1 is gone; chair-1 stands 3 m farther off; book-1's place is not in view; vase-1 stands where
monday saw nothing; lamp-1 stands where nobody looked on monday; chair-2 is only half seen; the rest is unchanged.
"""

from __future__ import annotations

from pathlib import Path

from supermap_cli.types.memory import MapDelta
from support import memories as m

TABLE, CUP, CHAIR, OTHER_CHAIR, TV, PLANT, BOOK, VASE, LAMP = range(1, 10)
TABLE_SIZE = (1.9, 0.9, 0.75)
CUP_SIZE = (0.08, 0.08, 0.1)
TV_SIZE = (0.1, 1.2, 0.7)
MONDAY = (1, 90)
TUESDAY = (1001, 1090)

monday = MapDelta(
    keyframes=m.keyframes([1, 40, 90]),
    instances=(
        m.instance(TABLE, "dining table", (0, 0, 0.375), TABLE_SIZE, seen=MONDAY),
        m.instance(CUP, "cup", (0.5, 0, 0.8), CUP_SIZE, seen=MONDAY),
        m.instance(CHAIR, "chair", (0, 1.0, 0.5), seen=MONDAY),
        m.instance(OTHER_CHAIR, "chair", (4.0, 0, 0.5), seen=MONDAY, observations=3),
        m.instance(TV, "tv", (5.0, 0, 1.2), TV_SIZE, seen=MONDAY),
        m.instance(PLANT, "potted plant", (0, 2.0, 0.4), (0.3, 0.3, 0.8), seen=MONDAY),
        m.instance(BOOK, "book", (-3.0, 0, 0.5), (0.2, 0.3, 0.05), seen=MONDAY, observations=3),
    ),
    observations=tuple(
        m.observation(number, at, label)
        for number, label in (
            (TABLE, "dining table"),
            (CUP, "cup"),
            (CHAIR, "chair"),
            (OTHER_CHAIR, "chair"),
            (TV, "tv"),
            (PLANT, "potted plant"),
            (BOOK, "book"),
        )
        for at in (1, 40, 90)
    ),
    states=(
        m.state(TABLE, 0, MONDAY, (0, 0, 0.375), TABLE_SIZE, label="dining table"),
        m.state(CUP, 0, MONDAY, (0.5, 0, 0.8), CUP_SIZE, label="cup"),
        m.state(CHAIR, 0, MONDAY, (0, 1.0, 0.5)),
        m.state(OTHER_CHAIR, 0, MONDAY, (4.0, 0, 0.5)),
        m.state(TV, 0, MONDAY, (5.0, 0, 1.2), TV_SIZE, label="tv"),
        m.state(PLANT, 0, MONDAY, (0, 2.0, 0.4), (0.3, 0.3, 0.8), label="potted plant"),
        m.state(BOOK, 0, MONDAY, (-3.0, 0, 0.5), (0.2, 0.3, 0.05), label="book"),
    ),
    visits=tuple(m.visit(number, 3, 3, 0, MONDAY) for number in range(TABLE, BOOK + 1)),
    spatial_edges=(
        m.spatial(CUP, "on", TABLE, 1),
        m.spatial(CHAIR, "near", PLANT, 1),
        m.spatial(CHAIR, "beside", TABLE, 1),
    ),
)

tuesday = MapDelta(
    keyframes=m.keyframes([1001, 1040, 1090]),
    instances=(
        m.instance(TABLE, "dining table", (0, 0, 0.375), TABLE_SIZE, seen=(1, 1090)),
        m.instance(CUP, "cup", (0.5, 0, 0.8), CUP_SIZE, seen=MONDAY, presence="absent", observations=3),
        m.instance(CHAIR, "chair", (-3.0, 3.0, 0.5), seen=(1, 1090)),
        m.instance(TV, "tv", (5.0, 0, 1.2), TV_SIZE, seen=(1, 1090)),
        m.instance(PLANT, "potted plant", (0, 2.0, 0.4), (0.3, 0.3, 0.8), seen=(1, 1090)),
        m.instance(VASE, "vase", (-0.5, 0, 0.9), (0.15, 0.15, 0.3), seen=TUESDAY, observations=3),
        m.instance(LAMP, "lamp", (9.0, 9.0, 0.9), (0.3, 0.3, 1.8), seen=TUESDAY, observations=3),
    ),
    observations=tuple(
        m.observation(number, at, label)
        for number, label in (
            (TABLE, "dining table"),
            (CHAIR, "chair"),
            (TV, "tv"),
            (PLANT, "potted plant"),
            (VASE, "vase"),
            (LAMP, "lamp"),
        )
        for at in (1001, 1040, 1090)
    ),
    states=(
        m.state(TABLE, 0, (1, 1090), (0, 0, 0.375), TABLE_SIZE, label="dining table"),
        m.state(CUP, 0, MONDAY, (0.5, 0, 0.8), CUP_SIZE, gone=1005, label="cup"),
        m.state(CHAIR, 0, MONDAY, (0, 1.0, 0.5), gone=1001),
        m.state(CHAIR, 1, TUESDAY, (-3.0, 3.0, 0.5)),
        m.state(TV, 0, (1, 1090), (5.0, 0, 1.2), TV_SIZE, label="tv"),
        m.state(PLANT, 0, (1, 1090), (0, 2.0, 0.4), (0.3, 0.3, 0.8), label="potted plant"),
        m.state(VASE, 0, TUESDAY, (-0.5, 0, 0.9), (0.15, 0.15, 0.3), empty_before=90, label="vase"),
        m.state(LAMP, 0, TUESDAY, (9.0, 9.0, 0.9), (0.3, 0.3, 1.8), label="lamp"),
    ),
    visits=(
        m.visit(TABLE, 3, 3, 0, TUESDAY),
        m.visit(CUP, 0, 3, 3),
        m.visit(CHAIR, 3, 3, 0, TUESDAY),
        m.visit(OTHER_CHAIR, 0, 2),
        m.visit(TV, 3, 3, 0, TUESDAY),
        m.visit(PLANT, 3, 3, 0, TUESDAY),
        m.visit(VASE, 3, 3, 0, TUESDAY),
        m.visit(LAMP, 3, 3, 0, TUESDAY),
    ),
    spatial_edges=(
        m.spatial(CUP, "on", TABLE, 1, 1005),
        m.spatial(CHAIR, "near", PLANT, 1, 1001),
        m.spatial(CHAIR, "beside", TABLE, 1, 1001),
        m.spatial(VASE, "on", TABLE, 1001),
    ),
    temporal_edges=(
        m.temporal("disappeared", (CUP, 0), (CUP, None), 90, 1005, probability=0.95),
        m.temporal("moved", (CHAIR, 0), (CHAIR, 1), 90, 1001, probability=0.85, distance_m=3.61),
        m.temporal("appeared", (VASE, None), (VASE, 0), 90, 1001, probability=0.9),
        m.temporal("candidate", (CUP, 0), (VASE, 0), 90, 1001, probability=0.2),
    ),
)


def make_kitchen(path: Path) -> Path:
    return m.make_memory(path, ("monday", (0, 100), monday), ("tuesday", (1000, 1100), tuesday))
