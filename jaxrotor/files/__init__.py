"""Files: scenes in TOML with units, shipped scenes, and files of other programs.

The public names are listed in `__init__.pyi`; each is loaded at its first use.
"""

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
