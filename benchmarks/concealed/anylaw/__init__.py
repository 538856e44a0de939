"""The third tier: any law of hysteresis, any drive, with a model to question or without one.

The second tier's truths obey a law that no model has; here nothing is known of the law at all, and
what counts is what the recording shows to one who knows none.  Beside each effect stands how much
of it is left after everything that depends on the path state alone: what is not left, the drive
cannot show, and that is then the right answer.

| file | what it holds |
|---|---|
| `laws/` | laws with return-point memory, memory that fades along the path, degrading loops |
| `drives.py` | ordinary drives, and the protocol that is made to tell |
| `effects.py` | the first tier's truths, as large and as slow as machines have them |
| `paths.py`, `oracle.py` | path states by Madelung's rules; what is left beyond them |
| `design.py`, `case.py`, `exam.py` | the list; one case; the two halves and their seals |
| `answer.py`, `measures.py`, `grade.py` | answers by the package; the marks |

Only `answer.py` imports fracjax.
"""
