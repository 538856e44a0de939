"""Parquet."""

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from fracjax._io import read
from fracjax._recording import InputError
from tests.io.layouts import (
    COUNT,
    DRIVE,
    RESPONSE,
)


def test_parquet_with_all_kinds_of_columns(tmp_path):
    path = tmp_path / "loop.parquet"
    table = {
        "remark": ["good"] * COUNT,
        "when": pyarrow.array(range(COUNT), pyarrow.timestamp("ms")),
        "pair": [{"a": 1}] * COUNT,
        "u.1": DRIVE,
        "y": RESPONSE.astype(np.float32),
        "code": pyarrow.array(range(COUNT), pyarrow.int16()),
    }
    parquet.write_table(pyarrow.table(table), path)
    recording = read(path)
    assert recording.dt == pytest.approx(1e-3)
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE.astype(np.float32))
    for name, fault in (("remark", "text or objects"), ("when", "dates"), ("pair", "text or obj")):
        with pytest.raises(InputError, match=f'"{name}": expected real numbers, found {fault}'):
            read(path, input=name, output="y", rate=200)
