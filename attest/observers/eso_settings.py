"""Settings of ``eso``; [ESO] and the symbols are those of `attest.observers.eso`."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from attest.config import Configuration, Initial, Section, Weights

Array = NDArray[np.float64]
Row = tuple[float, float, float]
Inertia = Row | tuple[Row, Row, Row] | None
Positive = Annotated[float, Field(gt=0)]


class Gains(Section):
    """Gains of [ESO] Proposition 3."""

    theorem = "[ESO, Theorem 1]"

    alpha: Annotated[float, Field(gt=0.5, lt=1)] = 0.85
    """Hölder exponent; nearer to 1 is smoother."""
    gamma: Annotated[float, Field(gt=0)] = 2.0
    """Degree of the Lyapunov function; gamma - 3 alpha + 1 >= 0."""
    kappa: Positive = 0.05
    """Coupling of residual into rate [1/s]. More follows the vectors more."""
    k_sigma: Positive = 100.0
    """Gain of the disturbance. More follows it quicker, and is noisier."""
    k_Psi: Positive = 20.0
    """Gain of the rate. More follows the gyroscope quicker, and is noisier."""

    @model_validator(mode="after")
    def _keep_the_lyapunov_function(self) -> "Gains":
        if self.gamma - 3.0 * self.alpha + 1.0 < 0.0:
            raise ValueError("gamma - 3 alpha + 1 >= 0 is needed [ESO, Theorem 2]")
        return self


class Plant(Section):
    """The rigid body, as far as it is known."""

    theorem = "[ESO, Theorem 1]"

    inertia: Inertia = None
    """J in the body, kg m²: its diagonal, or the whole matrix. null: 1 kg m² about each axis, so
    that torques read as angular accelerations."""
    torque: Row | None = None
    """Constant control torque in the body, N·m; null takes the log's torque, if it has any."""

    @field_validator("inertia")
    @classmethod
    def _be_positive(cls, inertia: Inertia) -> Inertia:
        if inertia is not None:
            J = inertia_matrix(inertia)
            if not np.allclose(J, J.T, rtol=1e-9) or np.linalg.eigvalsh(J).min() <= 0.0:
                raise ValueError("a symmetric positive definite J is needed [ESO, Theorem 1]")
        return inertia


class Start(Initial):
    """Where the observer starts."""

    disturbance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """sigma_hat = J^-1 tau_d, rad/s²."""


class Config(Configuration):
    """Configuration of ``eso``; the defaults suit flight logs."""

    observer: str = "eso"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))
    initial: Start = Start()
    plant: Plant = Plant()


def inertia_matrix(inertia: Inertia) -> Array:
    """Return J in full, shape (3, 3)."""
    if inertia is None:
        return np.eye(3)
    given = np.array(inertia)
    return np.diag(given) if given.ndim == 1 else given
