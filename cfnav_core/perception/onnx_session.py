"""Open an ONNX file for the CPU, with one kind of error for everything wrong with it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as state

# ONNX Runtime's exceptions share no base class of their own
_ERRORS = (
    state.Fail,
    state.InvalidArgument,
    state.InvalidGraph,
    state.InvalidProtobuf,
    state.NoSuchFile,
    state.NotImplemented,
    state.RuntimeException,
)


class Session(ort.InferenceSession):
    """A network that is open."""

    def run(
        self, outputs: Sequence[str] | None, inputs: dict[str, Any], options: Any = None
    ) -> Any:
        """Answer inputs by name with the outputs of these names, all when None.

        Raises:
            ValueError: they are of another type or shape than it takes, or it cannot compute them.
        """
        try:
            return super().run(outputs, inputs, options)
        except _ERRORS as error:
            raise ValueError(str(error)) from error


def open_session(network: Path | bytes, threads: int = 1) -> Session:
    """Open a network.

    Args:
        network: the ONNX file, or its bytes when it refers to no other file.
        threads: of ONNX Runtime, within an operator.

    Raises:
        ValueError: it is no ONNX network, or not one this version can run.
    """
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return Session(network, options, providers=["CPUExecutionProvider"])
    except _ERRORS as error:
        raise ValueError(str(error)) from error
