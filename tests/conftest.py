"""Settings every test runs under: double precision, and pictures without a window."""

import os


os.environ.setdefault("MPLBACKEND", "Agg")

import jax  # noqa: E402


jax.config.update("jax_enable_x64", True)
