"""Is physics inside a machine named, and nothing else?

| file | what it holds |
|---|---|
| `machines.py` | machines with one further effect, integrated by SciPy; no import from fracjax |
| `answers.py` | what the inquiry names on each of eighty recordings of them |

`answers.csv` has the cases that were run so far, and `python -m benchmarks.inside.answers
--missing` runs the others.
"""
