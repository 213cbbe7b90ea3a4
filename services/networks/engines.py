"""What runs a network: onnxruntime where it is installed, OpenCV's DNN otherwise.

onnxruntime takes about half the time. Both give the same numbers to 1e-3, and on one machine with
one number of threads each gives the same bits every time.
"""

from __future__ import annotations

import importlib
import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from threading import Timer
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError, SettingsError
from heel.services.networks.names import EngineName, printable

Floats = NDArray[np.float32]
_INSTALL = "pip install onnxruntime"
_log = logging.getLogger("heel.networks")
_CPU = "CPUExecutionProvider"
_PROVIDER = "executionprovider"
"""End of the names of providers, which may be left out."""
_AWAY = "AzureExecutionProvider"
"""The provider that would send pictures to a server."""
_QUIET = 4
"""Severity of what onnxruntime writes to standard error by itself: what ends the process."""
_PREFIX = re.compile(r"^\[ONNXRuntimeError\] : -?\d+ : \w+ : ")
_SHOWN_CHARS = 200
"""Of what an engine says is wrong: the part before the paths of its own source."""
_OUT_OF_MEMORY = ("allocate memory", "bad allocation", "bad_alloc", "alloc failed")
_ASLEEP = ("session.intra_op.allow_spinning", "session.inter_op.allow_spinning")
"""Threads that wait do so asleep: spinning ones take a core from the tracker between two frames."""


class Engine(Protocol):
    """A network that is ready to run."""

    @property
    def name(self) -> str:
        """What runs it, and on what, for people."""

    def run(
        self, blob: Floats, outputs: Sequence[str], longest_s: float | None = None
    ) -> list[Floats]:
        """Some outputs by name, as float32.

        Args:
            blob: (1, 3, H, W) float32, the pixels as the network wants them.
            outputs: their names.
            longest_s: time after which it is given up, where the engine can; None: never.

        Raises:
            HeelError: the engine failed, with its reason in one line.
            MemoryError: it wants more than there is.
        """


def open_engine(
    network: bytes, choice: EngineName = "auto", providers: Sequence[str] = (), threads: int = 1
) -> Engine:
    """Make a network ready.

    Args:
        network: ONNX, in one piece.
        choice: the engine; `auto` is onnxruntime where it is installed.
        providers: of onnxruntime: what runs the layers that it can, before the processor.
        threads: of onnxruntime; OpenCV's are the process's own (`cv2.setNumThreads`).

    Raises:
        SettingsError: the engine is not installed, or has no such provider.
        HeelError: the engine cannot run this network.
        MemoryError: it wants more than there is.
    """
    if choice == "opencv" or (choice == "auto" and onnxruntime() is None):
        given = {"model_providers": ", ".join(providers), "model_threads": threads}
        for name, value in given.items():
            if value not in ("", 1):
                raise SettingsError(
                    f"{name} {value}: it is onnxruntime's, and OpenCV runs the network: "
                    f"{_INSTALL} and leave model_engine out, or leave {name} out"
                )
        return OpenCv(network)
    if onnxruntime() is None:
        raise SettingsError(
            f"model_engine onnxruntime: it is not installed: {_INSTALL}, or choose opencv"
        )
    return OnnxRuntime(network, providers, threads)


@cache
def onnxruntime() -> Any:
    """The package, made silent; None where it is not installed or cannot be loaded."""
    try:
        package: Any = importlib.import_module("onnxruntime")
    except ModuleNotFoundError:
        return None
    except (ImportError, OSError) as error:
        _log.warning("onnxruntime is installed but cannot be loaded: %s", _first_line(error))
        return None
    package.set_default_logger_severity(_QUIET)
    package.disable_telemetry_events()
    return package


class OnnxRuntime:
    """A network in onnxruntime."""

    def __init__(
        self, network: bytes, providers: Sequence[str] = (), threads: int = 1,
        optimised: bool = True,
    ) -> None:  # fmt: skip
        """See `open_engine`; not optimised, every layer is computed as the file has it."""
        package = onnxruntime()
        wanted = _providers(package, providers)
        options = package.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.use_deterministic_compute = True
        options.log_severity_level = _QUIET
        if not optimised:
            options.graph_optimization_level = package.GraphOptimizationLevel.ORT_DISABLE_ALL
        for entry in _ASLEEP:
            options.add_session_config_entry(entry, "0")
        with one_line():
            # With its fallback it would run on the processor, and print that rather than raise it.
            self._session = package.InferenceSession(
                network, options, providers=[*wanted, _CPU], enable_fallback=0
            )
        for name in wanted:
            if name not in self._session.get_providers():
                raise SettingsError(
                    f"model_providers: {name} does not start here: see that its driver is "
                    "installed, or leave it out"
                )
        self._new_run_options = package.RunOptions
        self._input = self._session.get_inputs()[0].name
        self.name = " ".join(["onnxruntime", *(f"on {name}" for name in wanted[:1])])

    def run(
        self, blob: Floats, outputs: Sequence[str], longest_s: float | None = None
    ) -> list[Floats]:
        """See `Engine`."""
        with one_line():
            if longest_s is None:
                found = self._session.run(outputs, {self._input: blob})
            else:
                found = self._run_bounded(blob, outputs, longest_s)
        return [_numbers(one) for one in found]

    def _run_bounded(self, blob: Floats, outputs: Sequence[str], longest_s: float) -> Any:
        options = self._new_run_options()
        options.log_severity_level = _QUIET
        ending = Timer(longest_s, lambda: setattr(options, "terminate", True))
        ending.daemon = True
        ending.start()
        try:
            return self._session.run(outputs, {self._input: blob}, options)
        finally:
            ending.cancel()
            ending.join()


class OpenCv:
    """A network in OpenCV's DNN."""

    name = "OpenCV"

    def __init__(self, network: bytes) -> None:
        """See `open_engine`."""
        with one_line():
            self._network = cv2.dnn.readNetFromONNX(np.frombuffer(network, np.uint8))

    def run(
        self, blob: Floats, outputs: Sequence[str], longest_s: float | None = None
    ) -> list[Floats]:
        """See `Engine`; it cannot be given up."""
        with one_line():
            self._network.setInput(blob)
            # Of several outputs it gives all by name, or one alone.
            found = (
                [self._network.forward(outputs[0])] if len(outputs) == 1
                else self._network.forward(list(outputs))
            )  # fmt: skip
        return [np.asarray(one, np.float32) for one in found]


def _numbers(output: Any) -> Floats:
    if not isinstance(output, np.ndarray) or output.dtype.kind not in "fiub":
        raise HeelError("it has an output that is no array of numbers")
    return np.asarray(output, np.float32)


def _providers(package: Any, wanted: Sequence[str]) -> list[str]:
    """Providers by their whole names.

    Raises:
        SettingsError: one is not in this build of onnxruntime.
    """
    there = [name for name in package.get_available_providers() if name != _AWAY]
    by_name = {_short(name): name for name in there}
    unknown = [name for name in wanted if _short(name) not in by_name]
    if unknown:
        raise SettingsError(
            f"model_providers {', '.join(unknown)}: this onnxruntime has {', '.join(there)}; other "
            "builds of it bring others, onnxruntime-openvino or onnxruntime-gpu"
        )
    return [by_name[_short(name)] for name in wanted if by_name[_short(name)] != _CPU]


def _short(name: str) -> str:
    return name.lower().removesuffix(_PROVIDER)


@contextmanager
def one_line() -> Iterator[None]:
    """Makes one error of all that engines raise."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    except (MemoryError, SettingsError):
        raise
    except cv2.error as error:
        if error.code == cv2.Error.StsNoMem:
            raise MemoryError from None
        raise HeelError(_first_line(error)) from None
    except Exception as error:
        # onnxruntime's errors have no base of their own.
        text = _first_line(error)
        if any(words in str(error) for words in _OUT_OF_MEMORY):
            raise MemoryError from None
        raise HeelError(text) from None
    finally:
        cv2.utils.logging.setLogLevel(level)


def _first_line(error: Exception) -> str:
    lines = _PREFIX.sub("", str(error).strip()).splitlines() or [type(error).__name__]
    return printable(lines[0][:_SHOWN_CHARS])
