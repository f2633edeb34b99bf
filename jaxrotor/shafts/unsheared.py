"""Lines without shear: what their equations by a Green's function have in common."""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .greens import AbstractKernel, HeldKernel
from .line import AbstractLine


class AbstractUnshearedLine(AbstractLine):
    """Line of Euler's and Bernoulli's beam, with equations by its Green's function."""

    kernel: eqx.AbstractVar[AbstractKernel]
    # Stations of the displacements, also held ones [m]
    nodes: eqx.AbstractVar[Float[Array, " nodes"]]

    @property
    @abc.abstractmethod
    def sloped(self) -> Float[Array, " slopes"]:
        """Stations of the slopes, also held ones [m]."""

    @property
    @abc.abstractmethod
    def _free_nodes(self) -> list[int]:
        """Nodes at auxiliary constraints, whose displacements are the rigid motions."""

    @property
    @abc.abstractmethod
    def _unconstrained(self) -> np.ndarray:
        """Indices of the displacements and slopes that no constraint holds: the coordinates."""

    def restoring(self, bending: bool) -> Float[Array, "n n"]:
        """One but for rigid motions, whose equations state that auxiliary constraints have no reaction."""
        del bending
        nodes, sloped, free = self.nodes, self.sloped, self._free_nodes
        stiffness = jnp.eye(nodes.size + sloped.size)
        if isinstance(self.kernel, HeldKernel):
            for number, node in enumerate(free):
                motion = self.kernel.rigid_motion(number, nodes, sloped)
                stiffness = stiffness.at[:, node].add(-motion)
            stiffness = stiffness.at[jnp.array(free, int)].set(0.0)
        return stiffness[np.ix_(self._unconstrained, self._unconstrained)]
