"""The second tier: recordings whose hysteresis obeys none of the believed models.

In the first tier the stage obeys the model that is believed, and what is missing is an effect.  A
real stage obeys no model exactly.  Here the hysteresis is that of another law (`laws/`), beside it
is no effect, one or two, and the model that is believed is one of three.  A diagnosis must say what
dynamics is there, and name none where only the loop's shape differs.

| file | what it holds |
|---|---|
| `laws/` | eight laws without units, one file each but for the two Preisach planes |
| `signals.py`, `noises.py` | drives with corners, holds, unresolved edges; colours of noise |
| `stage.py` | a law scaled to volts and micrometres on one drive, with effects of the first tier |
| `oracle.py` | what a refit of the true law takes up of an effect |
| `rivals.py` | which effects could pass for another, to that oracle and to one who knows no law |
| `kinds.py`, `design.py`, `case.py`, `exam.py` | names; the list; one case; the exam |
| `measures.py`, `grade.py` | the marks |

Nothing here imports fracjax.
"""
