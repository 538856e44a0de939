"""Mutants are what they say they are, and leave texts, types and speed alone."""

import pytest

from benchmarks.mutation import choice
from benchmarks.mutation.mutants import places
from benchmarks.mutation.run import MACHINES, ROOT, sample, without_torn_row


def mutations(source: str) -> set[str]:
    return {mutant.apply(source) for ways in places("f.py", source) for mutant in ways}


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("x = a + b", {"x = (a - b)"}),
        ("x = (a  # a - b\n     - b)", {"x = ((a + b))"}),
        ("x = a * b ** c", {"x = (a / b ** c)", "x = a * (b * c)"}),
        ("µ = a < b", {"µ = (a <= b)", "µ = (a >= b)"}),
        ("x = a is None", {"x = (a is not None)"}),
        ("x = -y", {"x = y"}),
        ("x = 0", {"x = 1"}),
        ("x = 1.5", {"x = 3.0"}),
        ("def f(x=True): pass", {"def f(x=False): pass"}),
        ("if a and b: pass", {"if (a or b): pass", "if (not (a and b)): pass"}),
        ("if not a: pass", {"if a: pass"}),
        ("x = [a for a in b if a]", {"x = [a for a in b if (not a)]"}),
        ("x = np.max(y)", {"x = np.min(y)"}),
        ("x = y[a:-1]", {"x = y[(a + 1):-1]", "x = y[a:1]", "x = y[a:-2]"}),
        ("x += y", {"x -= y"}),
        ("def f(): return x", {"def f(): return None"}),
    ],
)
def test_a_place_goes_wrong_in_the_ways_that_are_usual(source, expected):
    assert mutations(source) == expected


@pytest.mark.parametrize(
    "source",
    [
        '"""Of 2 + 2."""',
        "from a import b",
        "raise ValueError(1 + 2)",
        "progress(1)",
        "x = f'{1 + 2}'",
        "def f(x: 'A | B') -> A | B: return None",
        "Given = A | B",
        "@lru_cache(maxsize=4)\ndef f(): pass",
        "zip(a, b, strict=True)",
        "_ROWS = 16",
    ],
)
def test_texts_types_and_speed_are_left_alone(source):
    assert mutations(source) == set()


def test_every_mutant_can_be_read_and_has_tests():
    for mutant in [*sample(1)[:200], *sample(1, MACHINES)[:100]]:
        source = (ROOT / mutant.file).read_text(encoding="utf-8")
        changed = mutant.apply(source)
        assert changed != source
        compile(changed, mutant.file, "exec")
        assert all((ROOT / test).is_file() for test in choice.tests_of(mutant.file))


def test_a_torn_row_is_cut_off(tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text("a,b\n1,2\n3")
    without_torn_row(path)
    assert path.read_text() == "a,b\n1,2\n"
