"""Conditioning that leaves measurements as they are, for observers with their own filters."""

from typing import Literal

from attest.config.sensors import Iron
from attest.config.settings import Conditioning, Gyroscope, Magnetometer, Smoothing


class RawGyroscope(Gyroscope):
    """The gyroscope as it is measured."""

    sample: Literal["ends", "begins"] = "begins"
    correct: bool = False


class RawSmoothing(Smoothing):
    """No low-pass."""

    accel_s: float | None = None
    mag_s: float | None = None


class RawMagnetometer(Magnetometer):
    """The field as it is measured."""

    calibrate: Literal["auto", "large", "off", False] | Iron = "off"
    decouple_tilt: bool = False
    disturbance: float | None = None


class RawConditioning(Conditioning):
    """What is left: one timeline, latency, and the accelerometer's reference."""

    gyroscope: RawGyroscope = RawGyroscope()
    smoothing: RawSmoothing = RawSmoothing()
    magnetometer: RawMagnetometer = RawMagnetometer()


class SmoothedMagnetometer(RawMagnetometer):
    """Without the iron that hides where to look for the rest of it."""

    calibrate: Literal["auto", "large", "off", False] | Iron = "large"


class SmoothedConditioning(RawConditioning):
    """That, and where the body is at rest."""

    rest: bool = True
    magnetometer: SmoothedMagnetometer = SmoothedMagnetometer()
