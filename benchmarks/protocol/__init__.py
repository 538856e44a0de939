"""Does a designed drive show what it promises, and more than others?

| file | what it holds |
|---|---|
| `stages.py` | actuators of the third tier's laws on the drives that fracjax designs for them |
| `promise.py` | effects at shares of the promised smallest size: which are named |
| `against.py` | the optimised drive beside the recipe and beside sines in four amplitudes |

The actuators and effects are those of `benchmarks.concealed`, which share no code with fracjax.

Where it falls short: a promise is of an effect's median shape; actual ones differ from it by more
than 1.5 in a third of the cases.
"""
