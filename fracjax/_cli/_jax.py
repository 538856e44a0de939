"""JAX as the commands want it."""

from __future__ import annotations

import os


def prepare_jax() -> None:
    """Keep compiled programs from one run to the next, silently; JAX's own variables go first."""
    import jax
    import platformdirs

    if "JAX_LOGGING_LEVEL" not in os.environ:
        # XLA calls a cached program's tuning flags an error, at any lower level.
        jax.config.update("jax_logging_level", "CRITICAL")
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        folder = platformdirs.user_cache_path("fracjax") / "xla"
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
