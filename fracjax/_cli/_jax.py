"""The configuration of JAX for the commands."""

from __future__ import annotations

import os


def prepare_jax() -> None:
    """Cache compiled programs between runs, silently; JAX's own variables take precedence."""
    import jax
    import platformdirs

    if "JAX_LOGGING_LEVEL" not in os.environ:
        # At any lower level XLA reports the tuning flags of a cached program as an error.
        jax.config.update("jax_logging_level", "CRITICAL")
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        folder = platformdirs.user_cache_path("fracjax") / "xla"
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
