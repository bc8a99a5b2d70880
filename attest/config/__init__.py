"""The configuration of a run: YAML, checked before anything is read.

Precedence: code defaults < YAML < ``--set``. What ran is saved with the results, and reproduces
them.
"""

from attest.config.alike import refuse_unlike, sampling, with_its_sensors
from attest.config.axes import Axes
from attest.config.check import validate
from attest.config.csv import Csv
from attest.config.files import dump, effective, find, folder, override, read, shipped
from attest.config.raw import RawConditioning, SmoothedConditioning
from attest.config.section import Section
from attest.config.sensors import Accelerometer, Iron
from attest.config.settings import (
    Conditioning,
    Configuration,
    Evaluation,
    Gyroscope,
    Initial,
    Input,
    Magnetometer,
    PointsConfiguration,
    SpecificForce,
    Vector,
    VectorWeights,
    Weights,
)
from attest.config.units import UNITS, Units

__all__ = [
    "UNITS",
    "Accelerometer",
    "Axes",
    "Conditioning",
    "Configuration",
    "Csv",
    "Evaluation",
    "Gyroscope",
    "Initial",
    "Input",
    "Iron",
    "Magnetometer",
    "PointsConfiguration",
    "RawConditioning",
    "Section",
    "SmoothedConditioning",
    "SpecificForce",
    "Units",
    "Vector",
    "VectorWeights",
    "Weights",
    "dump",
    "effective",
    "find",
    "folder",
    "override",
    "read",
    "refuse_unlike",
    "sampling",
    "shipped",
    "validate",
    "with_its_sensors",
]
