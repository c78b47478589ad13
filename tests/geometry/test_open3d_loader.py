import subprocess
import sys

import pytest

from supermap_cli.errors import SupermapError
from supermap_cli.geometry import open3d_loader


def run(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_open3d_loads_without_a_system_libusb_and_without_dash() -> None:
    code = (
        "import sys; from supermap_cli.geometry.open3d_loader import load_open3d; o3d = load_open3d();"
        "print(load_open3d() is o3d, 'dash' in sys.modules, hasattr(o3d.t.geometry, 'RaycastingScene'))"
    )
    assert run(code) == "True False True"


def test_the_plotting_left_out_comes_when_it_is_called() -> None:
    code = (
        "import sys; from supermap_cli.geometry.open3d_loader import load_open3d; o3d = load_open3d();"
        "figure = o3d.visualization.get_plotly_fig([o3d.geometry.PointCloud()]); print('plotly' in sys.modules)"
    )
    assert run(code) == "True"


def test_a_missing_open3d_is_an_error_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    open3d_loader.load_open3d.cache_clear()
    with pytest.raises(SupermapError, match=r"open3d cannot be imported.*pip install"):
        open3d_loader.load_open3d()
