"""Fits in processes of their own."""

import os
import threading

import fracjax as fj
import fracjax._batch._rows
from fracjax._batch._jobs import Held
from fracjax._batch._processes import in_processes
from fracjax._batch._rows import Work, rows_of
from tests.batch.helpers import OUT, recording


class Mortal(Held):
    """A recording that ends the process which unpacks it."""

    def __reduce__(self):
        return os._exit, (9,)


def test_processes_fit_as_fit_does_and_outlive_one_that_dies():
    work = Work("creep", None, None, 2, 0)
    jobs = [Held(recording(0)), Mortal(recording(1, source="deadly")), Held(recording(2))]
    rows = {row["key"]: row for some in in_processes(jobs, work, 1, 4) for row in some}
    assert len(rows) == 3
    for job in (jobs[0], jobs[2]):
        assert [rows[job.key]] == rows_of([job], work)
    lost = rows[jobs[1].key]
    assert (lost["status"], lost["source"]) == ("failed", "deadly")
    assert lost["reason"] == "the process that fitted it died."


def test_what_no_process_can_unpack_is_fitted_here(quick, monkeypatch):
    class Own(fj.Model):
        pass

    monkeypatch.setattr("fracjax._batch._batch._MANY", 1)
    rows = fj.fit_batch(Own(fj.blocks.Creep(), "creep"), [recording(0)], out=OUT)
    assert (len(quick), list(rows["status"])) == (1, ["fitted"])


def test_processes_end_with_what_asked_for_them():
    found = in_processes(
        [Held(recording(k)) for k in range(40)], Work("creep", None, None, 2, 0), 1, 4
    )
    assert next(found)
    found.close()
    assert not any(thread.name.endswith("(serve)") for thread in threading.enumerate())


def test_processes_take_over_where_they_are_worth_their_start(tmp_path, monkeypatch):
    """Of a hundred stacked recordings two stacks are fitted here, and the rest by processes."""
    taken = []

    def took(jobs, work, count, size):
        taken.append(len(jobs))
        yield rows_of(jobs, work)

    monkeypatch.setattr("fracjax._batch._batch.in_processes", took)
    monkeypatch.setattr("fracjax._batch._batch.os.cpu_count", lambda: 2)
    recordings = [recording(k, source=f"{k}") for k in range(100)]
    for name, worth in (("here", 1e9), ("there", 0.0)):
        monkeypatch.setattr("fracjax._batch._batch._WORTH_PROCESSES", worth)
        rows = fj.fit_batch("creep", recordings, out=tmp_path / name, starts=4)
        assert list(rows["source"]) == [each.source for each in recordings]
        assert set(rows["status"]) == {"fitted"}
    assert taken == [20]
