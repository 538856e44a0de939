"""What carries out remedies in these tests finds them, and finds those that do not work."""

import numpy as np
import pytest

from fracjax._recording import InputError
from tests import remedies
from tests.io.layouts import DRIVE, RESPONSE


@pytest.mark.parametrize(
    ("remedy", "ways"),
    [
        ("give --rate such as 200Hz, or --time as a name or an index", [["--rate", "200Hz"]]),
        ("give --output a or give --output 'b c'", [["--output", "a"], ["--output", "b c"]]),
        ("give --input 1 and --output 0", [["--input", "1", "--output", "0"]]),
        ('give --scale "drive=counts*0.1 mV"', [["--scale", "drive=counts*0.1 mV"]]),
        ("correct it, or give --mask bad to leave such samples out", [["--mask", "bad"]]),
        ("give --clock with its unit, or --clock s where it is in s", [["--clock", "s"]]),
        ("export the recording as CSV", []),
    ],
)
def test_remedies_are_found(remedy, ways):
    refusal = f"{InputError.at('loop.csv', 'one thing', 'another', remedy)}"
    assert remedies.alternatives(refusal) == ways


@pytest.mark.parametrize(
    ("remedy", "works"), [("give --rate such as 200Hz", True), ("give --mask bad", False),
                          ("give --frequency 200Hz", False)]
)  # fmt: skip
def test_a_remedy_that_does_not_work_is_found(tmp_path, remedy, works):
    path = tmp_path / "loop.csv"
    table = np.stack([DRIVE, RESPONSE], 1)
    np.savetxt(path, table, delimiter=",", header="voltage_V,displacement_um", comments="")

    def refuse(path, **_):
        raise InputError.at(f"{path}", "a time column or a rate", "neither", remedy)

    remedies.carried_out.clear()
    with pytest.raises(InputError):
        remedies.watched(refuse)(path)
    assert (not remedies.failed) == works
    remedies.failed.clear()
