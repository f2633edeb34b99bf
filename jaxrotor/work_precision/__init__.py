"""Accuracy and its cost in time: numbers of a scene, computed by many methods, with their errors."""

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["measures", "methods"])
