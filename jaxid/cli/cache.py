"""Compiled programs are kept between runs of the command line, which saves most of its time."""


def keep_compiled_programs() -> None:
    """Turn JAX's persistent compilation cache on, in the user's cache folder; without one, work without it.

    A cache folder that the user has set for JAX (`JAX_COMPILATION_CACHE_DIR`) stays.
    """
    import jax

    from .._kept import users_folder

    if jax.config.jax_compilation_cache_dir is None:  # type: ignore[attr-defined]
        folder = users_folder()
        if folder is None:
            return
        jax.config.update("jax_compilation_cache_dir", str(folder))
    # Small ones too: a run has two hundred, and reading one back is quicker than compiling it.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
