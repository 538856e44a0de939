"""One command in this process, and where its time went, as a line of JSON on stderr.

Run: python -m benchmarks.startup.stages COMMAND ARGUMENT…
"""

from __future__ import annotations

import builtins
import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from typing import Any

EVENTS = {
    "/jax/core/compile/jaxpr_trace_duration": "trace",
    "/jax/core/compile/jaxpr_to_mlir_module_duration": "lower",
    "/jax/core/compile/backend_compile_duration": "compile",
}
"""What JAX says of its own time; traces within traces count once."""
WRAPPED = {
    ("fracjax._io", "read_segments"): "read",
    ("fracjax._programs", "_read"): "load",
    ("fracjax._programs", "_write"): "store",
    ("fracjax._cli._results", "write_whole"): "write",
}
"""Functions whose time is a stage of its own."""

_spent: dict[str, float] = defaultdict(float)
_running: list[str] = []
_import = builtins.__import__


def _timed(stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
    """The function, its time counted for a stage and not for those around it."""

    @wraps(work)
    def run(*arguments: Any, **options: Any) -> Any:
        if stage in _running:
            return work(*arguments, **options)
        _running.append(stage)
        start, before = time.perf_counter(), sum(_spent.values())
        try:
            return work(*arguments, **options)
        finally:
            _running.pop()
            inside = sum(_spent.values()) - before
            _spent[stage] += time.perf_counter() - start - inside

    return run


def _importing(*arguments: Any, **options: Any) -> Any:
    """`__import__`, timed; what is loaded by it is wrapped."""
    module = _timed("import", _import)(*arguments, **options)
    if not _running:
        for (home, name), stage in list(WRAPPED.items()):
            loaded = sys.modules.get(home)
            work = None if loaded is None else vars(loaded).get(name)
            if work is not None:
                setattr(loaded, name, _timed(stage, work))
                del WRAPPED[home, name]
        _listen()
    return module


def _listen() -> None:
    """Have JAX tell its own time, once it is there."""
    if EVENTS and "jax" in sys.modules and "jax.monitoring" in sys.modules:
        events = dict(EVENTS)
        EVENTS.clear()

        def heard(event: str, seconds: float, **_: Any) -> None:
            if event in events:
                _spent[events[event]] += seconds

        sys.modules["jax.monitoring"].register_event_duration_secs_listener(heard)


def main() -> None:
    """Run the command, and say where its time went."""
    start, cpu = time.perf_counter(), time.process_time()
    builtins.__import__ = _importing
    from fracjax._cli._main import prepare, run

    prepare()
    status = run(sys.argv[1:])
    total = time.perf_counter() - start
    stages = {stage: round(seconds, 4) for stage, seconds in _spent.items()}
    facts = {"status": status, "total": total, "cpu": time.process_time() - cpu}
    print(json.dumps(facts | {"stages": stages}), file=sys.stderr)


if __name__ == "__main__":
    main()
