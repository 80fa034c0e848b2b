"""The numbers of the physics engine, in one place, with the reasons for them.

MuJoCo's contacts are soft: a friction force within its cone is answered by a small, steady sliding velocity. Three
things take that creep away where the Coulomb cone has room: elliptic cones (the pyramid's edges are weaker than its
corners), a ratio *impratio* of frictional to normal impedance above one, and a few iterations of the no-slip
projection after the main solver. ``tests/sim/test_creep.py`` measures what is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class Physics:
    """Settings of the engine, in SI units.

    *softness* is the time constant of a contact's spring and damper in steps; two is the stiffest that the
    integrator allows. *impedance* are the shares of a contact's acceleration that the constraint takes over, at zero
    and at full (*width*, in m) penetration. *rolling* is the coefficient of rolling friction in m: the
    offset of the normal force that stops a round object on a table, as the flattening of a real contact does.
    """

    timestep: float = 0.002
    softness: float = 2.0
    impedance: tuple[float, float] = (0.98, 0.995)
    width: float = 0.001
    impratio: float = 10.0
    iterations: int = 50
    noslip_iterations: int = 8
    noslip_tolerance: float = 1e-8
    rolling: float = 5e-4

    def __post_init__(self) -> None:
        if not (1e-5 <= self.timestep <= 0.01):
            raise InputError(f"timestep is {self.timestep} s; expected 1e-5 to 0.01")
        if not self.softness >= 2.0:
            raise InputError(f"softness is {self.softness} steps; below 2 the integration of a contact is unstable")
        low, high = self.impedance
        if not (0.0 < low <= high < 1.0):
            raise InputError(f"impedance is {self.impedance}; expected 0 < at zero penetration <= at full < 1")
        for name in ("width", "impratio"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InputError(f"{name} is {getattr(self, name)}; expected a positive number")
        for name in ("noslip_tolerance", "rolling"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise InputError(f"{name} is {getattr(self, name)}; expected 0 or more")
        for name in ("iterations", "noslip_iterations"):
            if getattr(self, name) < 0:
                raise InputError(f"{name} is {getattr(self, name)}; expected 0 or more")

    @property
    def solref(self) -> list[float]:
        """MuJoCo's *solref* of contacts: time constant in s and damping ratio."""
        return [self.softness * self.timestep, 1.0]

    @property
    def solimp(self) -> list[float]:
        """MuJoCo's *solimp* of contacts."""
        return [*self.impedance, self.width, 0.5, 2.0]

    @property
    def joint_solimp(self) -> list[float]:
        """MuJoCo's *solimp* of couplings between joints and of joint limits: as good as rigid."""
        return [0.9999, 0.9999, 0.001, 0.5, 2.0]
