"""Analyses of the linear rotor: by its roots, or over a revolution where coefficients are periodic.

`__init__.pyi` lists them; each is loaded on first use.
"""

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
