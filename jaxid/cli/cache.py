"""Compiled programs are kept between runs of the command line, which saves most of its time."""

import os
from pathlib import Path


def _folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME", "")
    # The specification says to ignore relative paths.
    return (Path(base) if os.path.isabs(base) else Path("~/.cache").expanduser()) / "jaxid"


def keep_compiled_programs() -> None:
    """Turn JAX's persistent compilation cache on, in the user's cache folder; without one, work without it.

    A cache folder that the user has set for JAX (`JAX_COMPILATION_CACHE_DIR`) stays.
    """
    import jax

    if jax.config.jax_compilation_cache_dir is None:  # type: ignore[attr-defined]
        folder = _folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):
            return
        if not os.access(folder, os.W_OK | os.X_OK):
            return
        jax.config.update("jax_compilation_cache_dir", str(folder))
    # Small ones too: a run has two hundred, and reading one back is quicker than compiling it.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
