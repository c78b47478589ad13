"""The one place that imports open3d: lazily, with libusb preloaded and without its plotting stack."""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any

from supermap_cli.errors import SupermapError

_PLOTTING_MODULE = "open3d.visualization.draw_plotly"


@cache
def load_open3d() -> Any:
    """Import open3d once and return the module; its own warnings, which go to stdout, are silenced.

    open3d's shared library needs `libusb-1.0.so.0` (for its depth camera drivers), which bare systems lack.
    The copy in the wheel `libusb-package` is loaded before: it carries that soname, so the dynamic linker takes it.

    Raises `SupermapError` with the cure when open3d cannot be imported.
    """
    _preload_libusb()
    try:
        with _plotting_deferred():
            open3d = importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise SupermapError(
            f"open3d cannot be imported: {error}",
            cure="run `pip install --force-reinstall open3d libusb-package` in this environment",
        ) from error
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d


def _preload_libusb() -> None:
    """Make the wheel's libusb known to the dynamic linker, if there is one."""
    if sys.platform != "linux":
        return
    try:
        path = importlib.import_module("libusb_package").get_library_path()
        if path is not None:
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        return  # the system may have a libusb; if not, importing open3d says so


@contextmanager
def _plotting_deferred() -> Iterator[None]:
    """Give open3d a stub of its plotly module: the real one imports dash, half of the import's time."""
    if "open3d" in sys.modules:
        yield
        return
    stub = ModuleType(_PLOTTING_MODULE)
    stub.__getattr__ = _deferred_plot_function  # type: ignore[method-assign]  # PEP 562: any name asked of the module
    sys.modules[_PLOTTING_MODULE] = stub
    try:
        yield
    finally:
        sys.modules.pop(_PLOTTING_MODULE, None)


def _deferred_plot_function(name: str) -> Callable[..., Any]:
    """A function that imports the true plotting module when it is called."""
    if name.startswith("__"):
        raise AttributeError(name)

    def plot(*arguments: Any, **keywords: Any) -> Any:
        return getattr(importlib.import_module(_PLOTTING_MODULE), name)(*arguments, **keywords)

    return plot
