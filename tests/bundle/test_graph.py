import numpy as np
import pytest

from punnet.bundle import Graph, load_bundle
from punnet.errors import BundleError

MEND = "make it again"


@pytest.fixture(scope="module")
def path():
    return load_bundle("weight-forest").path("model.onnx")


def test_what_the_file_declares_and_gives(path):
    graph = Graph(path, MEND, threads=1)
    kind, shape = graph.inputs["features"]
    assert kind == "float"
    assert shape[0] is None
    assert "grams" in graph.outputs
    features = np.ones((3, shape[1] or 1), dtype=np.float32)
    (grams,) = graph.run(["grams"], {"features": features}, "three")
    assert np.asarray(grams).reshape(-1).shape == (3,)


def test_a_failing_run_names_file_input_and_mend(path):
    graph = Graph(path, MEND)
    with pytest.raises(
        BundleError, match=r"model\.onnx: could not be run on three words \(.+\); make it again"
    ):
        graph.run(["grams"], {"features": np.array(["a", "b", "c"])}, "three words")


@pytest.mark.parametrize("content", [b"", b"not a graph", bytes(range(256))])
def test_what_is_no_graph_is_refused(tmp_path, content):
    path = tmp_path / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(
        BundleError, match=r"model\.onnx: can't be loaded as an ONNX graph \(.+\); make it again"
    ):
        Graph(path, MEND)
