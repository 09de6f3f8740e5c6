"""Signals inside a page: nothing is lost on the way; what is thinned keeps its extremes."""

import base64
import zlib

import numpy as np
import pytest
from grasp_cosim.report.embed import excerpt_of, packed
from report.javascript import run_node
from support.marks import slow

AWKWARD = [0.0, -0.0, 1.0, -1.0, 5e-324, 1.7976931348623157e308, np.inf, -np.inf, np.nan, 0.1, 1e-9]


def unpacked(text):
    """The inverse of packed(), written from its description."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8).reshape(8, -1)
    second = np.zeros(planes.shape[1], np.uint64)
    for k in range(8):
        second |= planes[k].astype(np.uint64) << np.uint64(8 * k)
    return np.cumsum(np.cumsum(second, dtype=np.uint64), dtype=np.uint64).view(np.float64)


@pytest.mark.parametrize(
    "values",
    [
        np.array(AWKWARD),
        np.sin(np.arange(10_000) * 1e-3) * 1e-6,
        np.random.default_rng(1).normal(size=1000) * 10.0 ** np.arange(-300, 300).repeat(2)[:1000],
        np.array([True, False, True]),
        np.array([-(2**31), 2**31 - 1, 0], np.int32),
        np.arange(24.0).reshape(8, 3)[:, 1],
        np.array([2.5]),
    ],
    ids=["awkward", "smooth", "random", "booleans", "integers", "strided", "single"],
)
def test_values_come_back_to_the_bit(values, tmp_path):
    text = packed(values)
    expected = values.astype(np.float64).tobytes()
    assert unpacked(text).tobytes() == expected
    script = """
      const planes = new Uint8Array(require("zlib").inflateSync(Buffer.from(input, "base64")));
      const values = unpack(planes, planes.length / 8);
      output(Buffer.from(values.buffer).toString("hex"));
    """
    assert run_node(["data.js"], script, text, tmp_path) == expected.hex()


def test_of_many_signals_a_page_takes_fewer_values():
    time = np.arange(5000.0)
    few, many = (excerpt_of(time, {str(k): time for k in range(count)}) for count in (499, 501))
    assert few.rows_per_pair is None
    assert len(many.time) * 502 <= 2_000_000
    assert len(many.signals) == 501


@pytest.mark.parametrize("rows", [1000, 1003])
def test_a_thinned_run_keeps_the_extremes_of_each_block_and_the_end(rows):
    time = np.linspace(0.0, 1.0, rows)
    signals = {
        "a.y": np.random.default_rng(rows).normal(size=rows),
        "a.touch": np.arange(rows) % 700 == 5,
    }
    shown = excerpt_of(time, signals, max_values=600)
    size = shown.rows_per_pair
    assert size is not None
    assert len(shown.time) * 3 <= 600
    assert (np.diff(shown.time) > 0).all()
    assert shown.time[-1] == time[-1]
    for name, values in signals.items():
        thin = shown.signals[name]
        assert thin.dtype == values.dtype
        assert len(thin) == len(shown.time)
        assert thin[-1] == values[-1]
        for pair in range((rows - 1) // size - 1):
            block = values[pair * size : (pair + 1) * size]
            first, second = thin[2 * pair : 2 * pair + 2]
            assert {first, second} == {block.min(), block.max()}
            assert (first == block.min()) == (block.argmin() <= block.argmax())
        assert (thin.min(), thin.max()) == (values.min(), values.max())


@pytest.mark.parametrize("rows", [slow(1), slow(17), 1000])
def test_extremes_of_pixel_columns_are_those_of_their_rows(rows, tmp_path):
    """Those of each column's rows, and of at most a quarter of a column beside it."""
    values = np.random.default_rng(rows).normal(size=rows)
    values[rows // 2] = np.nan
    for columns in (1, 7, 40):
        edges = np.linspace(0, rows, columns + 1).astype(int)
        script = """
          const levels = pyramid(Float64Array.from(input.values, (v) => v === null ? NaN : v));
          const { lows, highs } = envelope(levels, Int32Array.from(input.edges));
          output([...lows].map((low, i) => [low, highs[i]]));
        """
        plain = [None if np.isnan(v) else v for v in values.tolist()]
        given = {"values": plain, "edges": edges.tolist()}
        margin = rows / columns / 4
        for k, (low, high) in enumerate(run_node(["data.js"], script, given, tmp_path)):
            inner = values[edges[k] : edges[k + 1]]
            if not np.isfinite(inner).any():
                continue
            around = values[max(int(edges[k] - margin), 0) : int(np.ceil(edges[k + 1] + margin))]
            assert np.nanmin(around) <= low <= np.nanmin(inner)
            assert np.nanmax(inner) <= high <= np.nanmax(around)
