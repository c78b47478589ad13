"""ONNX models opened on a device, and run. Whatever goes wrong is one line that names the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from supermap_cli.errors import DetectorError, SupermapError
from supermap_cli.inference.model_file import check_model_file

DeviceName = Literal["auto", "cpu", "cuda", "tensorrt", "openvino", "coreml", "directml"]
"""Where a model runs; "auto" takes the first of `AUTOMATIC` that this onnxruntime has."""

PROVIDERS: Mapping[str, str] = {
    "cuda": "CUDAExecutionProvider",
    "directml": "DmlExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "cpu": "CPUExecutionProvider",
}
"""Device -> the execution provider of onnxruntime that runs on it."""

AUTOMATIC = ("cuda", "directml", "openvino", "cpu")
"""The preferred one first. TensorRT compiles a model for minutes and Core ML runs parts of many models only: they are
taken where they are named.
"""

_PACKAGES = {
    "cuda": "onnxruntime-gpu",
    "tensorrt": "onnxruntime-gpu",
    "openvino": "onnxruntime-openvino",
    "directml": "onnxruntime-directml",
}
"""Device -> the package of onnxruntime that has it; Core ML is in that for macOS."""

_TYPES: Mapping[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
    "tensor(uint8)": np.uint8,
    "tensor(bool)": np.bool_,
}
"""Tensor types of onnxruntime that a model may ask for."""


@dataclass(frozen=True)
class TensorDescription:
    """A model's input or output: its sides are numbers, or names (or `None`) where the model leaves them open."""

    name: str
    shape: tuple[int | str | None, ...]
    kind: str

    @property
    def dtype(self) -> type[np.generic] | None:
        """The numpy type; `None` for one that no model of ours takes."""
        return _TYPES.get(self.kind)

    def __str__(self) -> str:
        return f"{self.name} {list(self.shape)} {self.kind}"


class OnnxModel:
    """An ONNX model that can be run. Raises an error of `error_type` for a file that is none or does not load.

    `option` is the option that named the file. `warnings` says where another device is used than the one asked for.
    """

    def __init__(
        self,
        path: Path,
        *,
        option: str,
        threads: int = 0,
        device: str = "auto",
        error_type: type[SupermapError] = DetectorError,
    ) -> None:
        self.path = path
        self._error_type = error_type
        check_model_file(path, error_type, option=option)
        self._session, self.device, self.warnings = self._opened(device, threads)
        with self._loading():
            self.metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.inputs = tuple(_description(tensor) for tensor in self._session.get_inputs())
            self.outputs = tuple(_description(tensor) for tensor in self._session.get_outputs())

    @property
    def input_names(self) -> frozenset[str]:
        """The names of the inputs."""
        return frozenset(tensor.name for tensor in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """The names of the outputs, in the model's order."""
        return tuple(tensor.name for tensor in self.outputs)

    def input(self, name: str) -> TensorDescription | None:
        """The input of that name."""
        return next((tensor for tensor in self.inputs if tensor.name == name), None)

    def described(self) -> str:
        """Inputs and outputs in words."""
        return f"{', '.join(map(str, self.inputs))} -> {', '.join(map(str, self.outputs))}"

    def run(self, feeds: Mapping[str, NDArray[Any]], cure: str = "export it anew") -> dict[str, NDArray[Any]]:
        """The outputs by name, halves as float32; the feeds are cast to what the model takes.

        Raises an error of the model's type, with the `cure`, where it cannot be run.
        """
        cast = {}
        for tensor in self.inputs:
            if tensor.name in feeds and tensor.dtype is not None:
                cast[tensor.name] = np.ascontiguousarray(feeds[tensor.name], tensor.dtype)
        try:
            outputs = self._session.run(None, cast)
        except Exception as error:  # onnxruntime's errors share no base class
            raise self._error_type(
                f"the model does not run: {first_line(error)}", where=str(self.path), cure=cure
            ) from error
        return {
            name: np.asarray(output, np.float32) if output.dtype == np.float16 else output
            for name, output in zip(self.output_names, outputs, strict=True)
        }

    def _opened(self, device: str, threads: int) -> tuple[Any, str, tuple[str, ...]]:
        """A session, the device it runs on, and a line where that is not the one asked for."""
        settings = onnxruntime.SessionOptions()
        settings.intra_op_num_threads = threads
        settings.add_session_config_entry("session.intra_op.allow_spinning", "0")  # mapping runs beside it
        settings.log_severity_level = 4
        available = onnxruntime.get_available_providers()
        if device == "auto":
            wanted = next((name for name in AUTOMATIC if PROVIDERS[name] in available), "cpu")
        else:
            wanted = device
        why = None if PROVIDERS[wanted] in available else _not_available(wanted)
        session = None
        if why is None and wanted != "cpu":
            session, why = self._on_accelerator(wanted, settings)
        if session is None:
            with self._loading():
                session = onnxruntime.InferenceSession(str(self.path), settings, providers=[PROVIDERS["cpu"]])
        if why is None:
            return session, wanted, ()
        return session, "cpu", (f"{self.path.name} runs on the CPU, not on {wanted}: {why}",)

    def _on_accelerator(self, device: str, settings: Any) -> tuple[Any | None, str | None]:
        """A session on the device, or why there is none."""
        providers = [PROVIDERS[device], PROVIDERS["cpu"]]
        if device == "tensorrt":
            providers.insert(1, PROVIDERS["cuda"])
        available = onnxruntime.get_available_providers()
        usable = [provider for provider in providers if provider in available]
        try:
            session = onnxruntime.InferenceSession(str(self.path), settings, providers=usable)
        except (
            Exception
        ) as error:  # onnxruntime's errors share no base class; the CPU tells whether the model is at fault
            return None, first_line(error)
        if PROVIDERS[device] not in session.get_providers():
            return None, "its libraries cannot be loaded"
        return session, None

    @contextmanager
    def _loading(self) -> Iterator[None]:
        """Turns whatever a damaged model raises into an error that names it."""
        try:
            yield
        except Exception as error:  # onnxruntime's errors share no base class
            raise self._error_type(
                f"the model cannot be loaded: {first_line(error)}",
                where=str(self.path),
                cure="it is damaged or no ONNX model; get or export it anew",
            ) from error


def first_line(error: Exception) -> str:
    """The first line of an error's text, or its type."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__


def sides(description: TensorDescription, axes: Sequence[int]) -> tuple[int | None, ...]:
    """The sides along some axes; `None` where the model leaves one open."""
    return tuple(side if isinstance(side := description.shape[axis], int) else None for axis in axes)


def _description(tensor: Any) -> TensorDescription:
    return TensorDescription(tensor.name, tuple(tensor.shape), tensor.type)


def _not_available(device: str) -> str:
    package = _PACKAGES.get(device)
    return f"this onnxruntime lacks it{f' (it is in the package {package})' if package else ''}"
