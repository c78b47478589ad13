"""SuperMap: a robot's recording becomes a 4D memory that can be asked in plain words.

What a plugin imports: `hookimpl`, `Options`, `Register` and `RecordingRequest` from here; everything else from
`supermap_cli.protocols`, `supermap_cli.types`, `supermap_cli.geometry` and `supermap_cli.errors`.

What a program imports that asks a map: `open`, which gives a `Memory`.
"""

from typing import TYPE_CHECKING

from supermap_cli.version import __version__

if TYPE_CHECKING:
    from supermap_cli.hookspecs import Options, RecordingRequest, Register, hookimpl
    from supermap_cli.memory_api import Memory
    from supermap_cli.memory_api import open_memory as open  # noqa: A004 - as `Image.open` and `gzip.open`

_FROM_HOOKSPECS = frozenset({"Options", "RecordingRequest", "Register", "hookimpl"})

_FROM_MEMORY_API = {"Memory": "Memory", "open": "open_memory"}

__all__ = ["Memory", "Options", "RecordingRequest", "Register", "__version__", "hookimpl", "open"]


def __getattr__(name: str) -> object:
    if name in _FROM_HOOKSPECS:
        from supermap_cli import hookspecs  # noqa: PLC0415 - keeps `import supermap_cli` light

        return getattr(hookspecs, name)
    if name in _FROM_MEMORY_API:
        from supermap_cli import memory_api  # noqa: PLC0415 - as above

        return getattr(memory_api, _FROM_MEMORY_API[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
