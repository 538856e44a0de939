"""Compiled programs are forgotten before memory maps run out."""

import jax

from fracjax._solve import _programs
from fracjax._solve._programs import limit_compiled_programs


def test_programs_are_forgotten_before_the_process_runs_out_of_maps(tmp_path, monkeypatch):
    compiled = jax.jit(lambda x: x + 1)
    monkeypatch.setattr(_programs, "_LIMIT", tmp_path / "limit")
    (tmp_path / "limit").write_text("1000000\n")
    _programs._clear_when_full.cache_clear()
    compiled(1.0)
    limit_compiled_programs()
    assert compiled._cache_size() == 1  # type: ignore[attr-defined]
    (tmp_path / "limit").write_text("100\n")
    _programs._clear_when_full.cache_clear()
    limit_compiled_programs()
    assert compiled._cache_size() == 0  # type: ignore[attr-defined]
    monkeypatch.setattr(_programs, "_MAPS", tmp_path / "no such system")
    _programs._clear_when_full.cache_clear()
    limit_compiled_programs()
