"""Sweeps: many trajectories at once, observed as they run, kept in stores, classified by attractor."""

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["observe"])
