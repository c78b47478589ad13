"""SuperMap: a robot's recording becomes a 4D memory that can be asked in plain words.

What a plugin imports: `hookimpl`, `Options`, `Register` and `RecordingRequest` from here; everything else from
`supermap_cli.protocols`, `supermap_cli.types`, `supermap_cli.geometry` and `supermap_cli.errors`.
"""

from typing import TYPE_CHECKING

from supermap_cli.version import __version__

if TYPE_CHECKING:
    from supermap_cli.hookspecs import Options, RecordingRequest, Register, hookimpl

_FROM_HOOKSPECS = frozenset({"Options", "RecordingRequest", "Register", "hookimpl"})

__all__ = ["Options", "RecordingRequest", "Register", "__version__", "hookimpl"]


def __getattr__(name: str) -> object:
    if name in _FROM_HOOKSPECS:
        from supermap_cli import hookspecs  # noqa: PLC0415 - keeps `import supermap_cli` light

        return getattr(hookspecs, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
