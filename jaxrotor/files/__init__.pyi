"""Public names of `jaxrotor.files`; each is loaded at its first use."""

from .shipped import shipped as shipped
from .toml import (
    dumps as dumps,
    load as load,
    loads as loads,
    save as save,
    study as study,
    title as title,
)
from .units import SceneError as SceneError
