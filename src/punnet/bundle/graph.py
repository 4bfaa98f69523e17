"""An ONNX graph of a bundle on ONNX Runtime, with errors that name the file and say what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from punnet.errors import BundleError

__all__ = ["Graph"]

LONGEST_REASON = 200


class Graph:
    """A graph that has been opened.

    Parameters
    ----------
    path
        The ONNX file.
    mend
        What its user does if it is broken, for the errors.
    threads
        Cores for one operator; 0 leaves it to the runtime, which takes all.

    Attributes
    ----------
    inputs, outputs
        Type and shape by name, as the file declares them; sizes that it leaves open are None.

    Raises
    ------
    BundleError
        If the file is no ONNX graph.
    """

    def __init__(self, path: Path, mend: str, *, threads: int = 0) -> None:
        import onnxruntime

        self._path, self._mend = path, mend
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 4  # what goes wrong is told by the exception
        options.inter_op_num_threads = 1
        options.intra_op_num_threads = threads
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
        except Exception as error:
            raise BundleError(
                f"{path}: can't be loaded as an ONNX graph ({_first_line(error)}); {mend}"
            ) from error
        self.inputs = _declared(self._session.get_inputs())
        self.outputs = _declared(self._session.get_outputs())

    def run(self, outputs: Sequence[str], feeds: Mapping[str, Any], on: str) -> list[Any]:
        """Return the named outputs for ``feeds``; ``on`` says in an error what it was run on.

        Raises
        ------
        BundleError
            If the graph fails.
        """
        try:
            return list(self._session.run(list(outputs), dict(feeds)))
        except Exception as error:
            raise BundleError(
                f"{self._path}: could not be run on {on} ({_first_line(error)}); {self._mend}"
            ) from error


def _declared(values: Sequence[Any]) -> dict[str, tuple[str, tuple[int | None, ...]]]:
    return {
        value.name: (
            str(value.type).removeprefix("tensor(").removesuffix(")"),
            tuple(size if isinstance(size, int) else None for size in value.shape),
        )
        for value in values
    }


def _first_line(error: Exception) -> str:
    return (str(error).strip().partition("\n")[0] or type(error).__name__)[:LONGEST_REASON]
