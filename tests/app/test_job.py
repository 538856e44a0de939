"""A computation in the background: its stage, its end, Stop, and its limit of time."""

import threading
import time

from fracjax._app._job import Job
from fracjax._computing import map_in_threads
from fracjax._recording import InputError


def ended(job: Job) -> Job:
    while job.running:
        time.sleep(0.01)
    return job


def in_stages(progress) -> str:
    for stage in range(1000):
        progress(f"stage {stage}")
        time.sleep(0.01)
    return "never reached"


def test_a_result():
    job = ended(Job(lambda progress: progress("reading") or 7, 60))
    assert (job.result, job.message, job.stage) == (7, "", "reading")


def test_stop_ends_it_at_the_next_stage():
    job = Job(in_stages, 60)
    while job.stage == "starting":
        time.sleep(0.01)
    job.stop()
    ended(job)
    assert job.elapsed < 5
    assert (job.result, job.message) == (None, "stopped")


def test_what_a_round_has_done_is_shown_with_its_time_and_stop_ends_it_there():
    release = threading.Semaphore(0)

    def compute(progress):
        progress("fitting foh")
        map_in_threads(lambda k: release.acquire() and time.sleep(0.05), range(100))

    job = Job(compute, 60)
    release.release(10)
    while not job.forecast.startswith("10 of 100, about "):
        time.sleep(0.01)
    assert job.forecast.endswith(" s more of this round")
    assert job.running
    job.stop()
    release.release(90)
    ended(job)
    assert job.message == "stopped"
    assert job.elapsed < 4  # of 5 s on one thread, 2.5 s on two; it stops at the next item


def test_its_limit_ends_it():
    job = ended(Job(in_stages, 0.1))
    assert job.result is None
    assert "limit" in job.message
    assert job.remaining == 0


def test_a_verdict_so_far_is_a_result():
    def compute(progress):
        try:
            in_stages(progress)
        except KeyboardInterrupt:
            progress("writing the verdict")
            return "so far"

    job = ended(Job(compute, 0.1))
    assert (job.result, job.message, job.stage) == ("so far", "", "writing the verdict")


def test_what_is_wrong_with_the_input_is_said():
    def compute(progress):
        raise InputError.at("a.csv", "numbers", "words", "correct it")

    assert ended(Job(compute, 60)).message == str(
        InputError.at("a.csv", "numbers", "words", "correct it")
    )
