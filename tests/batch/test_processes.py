"""Fits in processes of their own."""

import os
import threading
from contextlib import closing

import fracjax as fj
import fracjax._batch._rows
from fracjax._batch._jobs import Held
from fracjax._batch._processes import Processes, _CannotStart
from fracjax._batch._rows import Work, rows_of
from fracjax._batch._waiting import FEWEST, Waiting
from tests.batch.helpers import OUT, recording


class Mortal(Held):
    """A recording that ends the process which unpacks it."""

    def __reduce__(self):
        return os._exit, (9,)


def test_processes_fit_as_fit_does_and_outlive_one_that_dies():
    work = Work("creep", None, None, 2, 0)
    jobs = [Held(recording(0)), Mortal(recording(1, source="deadly")), Held(recording(2))]
    with closing(Processes(Waiting(jobs, 1), work)) as processes:
        processes.start(1, 4)
        rows = {row["key"]: row for some in processes.rest() for row in some}
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
    waiting = Waiting([Held(recording(k)) for k in range(40)], 1)
    with closing(Processes(waiting, Work("creep", None, None, 2, 0))) as processes:
        processes.start(1, 4)
        assert next(processes.rest())
    assert len(waiting) == 0
    assert not any(thread.name.endswith("(_feed)") for thread in threading.enumerate())


def test_no_process_is_waited_for_that_has_nothing_to_do(monkeypatch):
    """It is still starting when the last recording is taken by another."""

    def never_ready(worker):
        worker.process.wait()
        raise _CannotStart

    monkeypatch.setattr("fracjax._batch._processes._Worker.confirm", never_ready)
    waiting = Waiting([Held(recording(0))], 2)
    with closing(Processes(waiting, Work("creep", None, None, 2, 0))) as processes:
        processes.start(1, 4)
        waiting.take(4)
        rest = threading.Thread(target=lambda: list(processes.rest()), daemon=True)
        rest.start()
        rest.join(20)
        assert not rest.is_alive()


def test_processes_help_where_they_are_worth_their_start(tmp_path, monkeypatch):
    """Of a hundred stacked recordings two stacks are fitted here, then as many as others leave."""
    started = []

    class Other(Processes):
        def start(self, count, size):
            """A process that finishes one stack at once."""
            started.append((count, len(self._jobs)))
            self.started = True
            self._rows.put(rows_of(self._jobs.take(size), self._work))

    monkeypatch.setattr("fracjax._batch._batch.Processes", Other)
    monkeypatch.setattr("fracjax._batch._batch.os.cpu_count", lambda: 2)
    # Each stack is as small as the first.
    monkeypatch.setattr("fracjax._batch._batch._ANSWER", 0.0)
    recordings = [recording(k, source=f"{k}") for k in range(100)]
    for name, worth in (("here", 1e9), ("there", 0.0)):
        monkeypatch.setattr("fracjax._batch._batch._WORTH_PROCESSES", worth)
        rows = fj.fit_batch("creep", recordings, out=tmp_path / name, starts=4)
        assert list(rows["source"]) == [each.source for each in recordings]
        assert set(rows["status"]) == {"fitted"}
    assert started == [(1, 92)]


def test_a_killed_process_costs_no_recording():
    """Killed between two of its answers: a new one fits what it had taken."""
    jobs = [Held(recording(k, source=f"{k}")) for k in range(40)]
    with closing(Processes(Waiting(jobs, 1), Work("creep", None, None, 2, 0))) as processes:
        processes.start(1, 4)
        rest = processes.rest()
        rows = next(rest)
        processes._workers[0].process.kill()
        rows += [row for some in rest for row in some]
    assert {row["key"] for row in rows} == {job.key for job in jobs}
    assert {row["status"] for row in rows} == {"fitted"}


def test_whoever_takes_gets_each_recording_once_and_less_towards_the_end():
    jobs = [Held(recording(k, source=f"{k}")) for k in range(100)]
    waiting = Waiting(jobs, takers=2)
    taken = []
    while stack := waiting.take(64):
        taken.append(stack)
    assert [len(stack) for stack in taken] == [50, 25, 16, 9]
    assert [job for stack in taken for job in stack] == jobs
    assert Waiting(jobs, takers=1).take(64) == jobs[:64]
    assert Waiting(jobs, takers=40).take(64) == jobs[:FEWEST]
