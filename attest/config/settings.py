"""Every key of a configuration: meaning, unit, range and default.

An observer's module extends `Configuration` by its gains; the rest is the same for all.
"""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from attest.config.axes import Axes
from attest.config.csv import Csv
from attest.config.section import Section
from attest.config.sensors import Accelerometer, Iron, Matrix3, Vector3
from attest.config.units import Units

Quaternion = tuple[float, float, float, float]
Rate = Annotated[float, Field(ge=-1e3, le=1e3)]
"""rad/s; no body turns as fast."""


class Weights(Section):
    """Weights K of Wahba's cost."""

    k: Vector3 = (3.0, 2.0, 1.0)
    """Along north, east and the vertical, whichever axes of the world these are; a turn about one
    of them feels the sum of the other two."""

    @field_validator("k")
    @classmethod
    def _make_cost_a_morse_function(cls, k: Vector3) -> Vector3:
        if len(set(k)) < 3 or min(k) < 1.0:
            raise ValueError("three distinct values of at least 1 are needed [FTS, Lemma 1]")
        return k


class VectorWeights(Weights):
    """Weights of Wahba's cost, of the world's axes or of the vectors."""

    w: dict[str, Annotated[float, Field(gt=0)]] | None = None
    """A weight for each vector by its signal, 1 for what is not named, in place of k: W = diag(w),
    without cross products. null: k."""


class Initial(Section):
    """Where the observer starts."""

    attitude: Literal["triad", "identity"] | Quaternion = "triad"
    """From the first vectors (triad), identity, or a quaternion [w, x, y, z], body to world."""
    bias: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)
    """Gyroscope bias, rad/s."""
    angular_velocity: tuple[Rate, Rate, Rate] | None = None
    """Estimate of the angular velocity, rad/s; null takes the first measurement less the bias."""

    @field_validator("attitude")
    @classmethod
    def _refuse_zero(cls, attitude: str | Quaternion) -> str | Quaternion:
        if not isinstance(attitude, str) and sum(x * x for x in attitude) < 1e-12:
            raise ValueError("a quaternion of length zero is no attitude")
        return attitude


class Vector(Section):
    """A direction that is measured in the body and known in the world."""

    signal: str
    """Name of the signal, such as accel, mag, or a CSV's further vector."""
    reference: Literal["gravity", "specific_force", "magnetic", "north"] | Vector3 | None = None
    """gravity; specific_force (needs velocity); magnetic (World Magnetic Model at place and date);
    north (magnetic north, dip from the log); [x, y, z] in the world. null: what suits the signal
    and the log best."""

    @field_validator("reference")
    @classmethod
    def _refuse_zero(cls, reference: str | Vector3 | None) -> str | Vector3 | None:
        if isinstance(reference, tuple) and not any(reference):
            raise ValueError("a vector of length zero has no direction")
        return reference


class SpecificForce(Section):
    """The accelerometer's reference a - g from the log's velocity."""

    smoothing_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Standard deviation of the Gaussian that smooths acceleration and accelerometer alike, s."""
    lag_s: Annotated[float | None, Field(ge=-5, le=5)] = None
    """How late the log's velocity is, s; null finds it from |a - g| and |accelerometer|."""


class Gyroscope(Section):
    """The gyroscope's own errors, as far as is known at each sample of what came before it."""

    sample: Literal["ends", "begins"] = "ends"
    """A sample is the mean rate over the step that ends at its stamp, as sensors measure it, or
    holds over the step that begins there, as the papers' simulations have it."""
    correct: bool = True
    """Take off bias (told by rest), scale and misalignment (told by how gravity drifts in the frame
    that the gyroscope integrates)."""
    bias_std: Annotated[float, Field(ge=0, le=1)] = 0.03
    """Standard deviation of the bias before anything is known of it, rad/s."""
    scale_std: Annotated[float, Field(ge=0, le=0.1)] = 0.004
    """Of scale and misalignment, 1."""
    bias: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)
    """Bias that is known before, rad/s: taken off from the start, and corrected from there."""
    scale: Matrix3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Scale and misalignment S that are known before, by rows, 1: the gyroscope errs by S times
    what it reads."""

    @field_validator("scale")
    @classmethod
    def _refuse_large(cls, scale: Matrix3) -> Matrix3:
        if max(abs(x) for row in scale for x in row) > 0.5:
            raise ValueError("no gyroscope errs by half of what it reads")
        return scale


class Smoothing(Section):
    """Low-pass of directions in the frame that the gyroscope integrates."""

    accel_s: Annotated[float | None, Field(gt=0, le=600)] = 3.0
    """Time constant of the accelerometer where its reference is constant, s; null leaves it raw."""
    mag_s: Annotated[float | None, Field(gt=0, le=600)] = 9.0
    """Time constant of the magnetometer, s; null leaves it raw."""


class Magnetometer(Section):
    """The magnetometer's own ways."""

    calibrate: Literal["auto", "large", "off", False] | Iron = "auto"
    """Hard and soft iron: auto finds them from the whole log and takes them off where held-back
    parts of the log show that this helps; large does so where hard iron is over a tenth of the
    field only, and leaves less to an observer that finds it itself; off leaves the field as it is
    measured; given ones are taken off."""
    decouple_tilt: bool = True
    """Use only what is across the accelerometer's direction, so that it never corrects tilt."""
    disturbance: Annotated[float | None, Field(gt=0)] = 0.12
    """Difference from the field of before, as a share of its strength, at which a sample is half
    believed; null believes each."""

    latency_s: Annotated[float | None, Field(ge=0, le=5)] = None
    """How late its values are against the gyroscope, s; null finds it from the log's turns."""

    @field_validator("calibrate")
    @classmethod
    def _read_off(
        cls, calibrate: Literal["auto", "large", "off", False] | Iron
    ) -> Literal["auto", "large", "off"] | Iron:
        return calibrate or "off"  # YAML takes a plain off for false


class Conditioning(Section):
    """What is done to the measurements before the observer sees them."""

    max_step_s: Annotated[float, Field(gt=0, le=10)] = 0.025
    """Longest step of the observer; a slower log is sub-stepped, its gyroscope interpolated."""
    max_age_s: Annotated[float, Field(ge=0, le=600)] = 1.0
    """How far a vector may be carried by the gyroscope from its nearest sample."""
    restart_gap_s: Annotated[float, Field(gt=0)] = 5.0
    """A gyroscope silent for longer than this makes the observer start anew; and for less where the
    motion around is so quick that the turn in between is not told."""
    rest: bool = False
    """Mark where the body is at rest, as the whole log tells; ``smoother`` uses it."""
    gyroscope: Gyroscope = Gyroscope()
    accelerometer: Accelerometer = Accelerometer()
    specific_force: SpecificForce = SpecificForce()
    smoothing: Smoothing = Smoothing()
    magnetometer: Magnetometer = Magnetometer()


class Topics(Section):
    """ROS topics to read each signal from; null takes the best."""

    gyro: str | None = None
    """Angular velocity."""
    accel: str | None = None
    """Specific force."""
    mag: str | None = None
    """Magnetic field."""
    velocity: str | None = None
    """Velocity along the axes of the world."""
    position: str | None = None
    """Latitude, longitude, altitude."""
    torque: str | None = None
    """Torque."""
    points: str | None = None
    """Feature points."""
    reference: str | None = None
    """The reference to put first."""


class Input(Section):
    """How the log is read."""

    imu: str | None = None
    """Message or topic to take the inertial signals from; null takes the best."""
    topics: Topics = Topics()
    """ROS topics to read each signal from."""
    vehicle: str | None = None
    """System id, or system/component, where a log has several vehicles."""
    world: Literal["ned", "enu"] | None = None
    """World axes of a format that does not say; null is enu for ROS, and ned for others."""
    csv: Csv | None = None
    """Columns and units of a CSV; null: those that its header names."""
    unit: Units = Units()
    """Units of the numbers of other logs, where these are not SI."""
    axes: Axes = Axes()
    """Axes that the sensors of any log lie along, where these are not the body's."""
    start_s: Annotated[float | None, Field(ge=0)] = None
    """Leave out what is earlier than this, seconds from the log's first gyroscope sample."""
    end_s: Annotated[float | None, Field(gt=0)] = None
    """Leave out what is later than this, seconds from the log's first gyroscope sample."""


class Evaluation(Section):
    """How the estimate is compared."""

    reference: str | None = None
    """Name of the reference, or a file that holds one; null takes the best of the log, none
    compares with nothing, smoother with attest's own over the whole log."""
    settling_bound_deg: Annotated[float, Field(gt=0, le=180)] = 5.0
    """The total error counts as settled when it stays below this."""
    reference_shift_s: Annotated[float, Field(ge=-4e9, le=4e9)] | Literal["auto"] = 0.0
    """Added to the stamps of the reference, whose clock is another one, s; auto: so that it turns
    when the gyroscope does."""
    longest_gap_s: Annotated[float, Field(gt=0)] = 2.0
    """The reference is never interpolated across a longer gap than this."""
    apply_time_offset: bool = False
    """Shift the reference by the time offset that was found before scoring."""
    apply_heading_offset: bool = False
    """Take the constant heading offset out before scoring."""
    apply_misalignment: bool = False
    """Take the constant rotation between the two bodies out before scoring."""

    @field_validator("reference")
    @classmethod
    def _refuse_no_name(cls, reference: str | None) -> str | None:
        if reference == "":
            raise ValueError("an empty name. Name a reference, a file, smoother or none")
        return reference


class Configuration(Section):
    """What every observer's configuration has."""

    observer: str
    weights: Weights = Weights()
    initial: Initial = Initial()
    vectors: tuple[Vector, ...] | None = None
    """null: accelerometer and magnetometer, as far as the log has them."""
    input: Input = Input()
    conditioning: Conditioning = Conditioning()
    evaluation: Evaluation = Evaluation()

    @field_validator("input")
    @classmethod
    def _refuse_nothing(cls, wanted: Input) -> Input:
        if wanted.end_s is not None and wanted.end_s <= (wanted.start_s or 0.0):
            raise ValueError("the end is not behind the start")
        return wanted

    @field_validator("vectors")
    @classmethod
    def _refuse_twice(cls, vectors: tuple[Vector, ...] | None) -> tuple[Vector, ...] | None:
        names = [vector.signal for vector in vectors or ()]
        if len(set(names)) < len(names):
            raise ValueError("a signal is named twice")
        return vectors


class PointsConfiguration(Configuration):
    """What an observer of feature points has besides."""

    points: dict[str, Vector3] | None = None
    """Place of each feature point in the object's frame, m, by its signal; null: the log's vectors
    are used as they are."""

    @field_validator("points")
    @classmethod
    def _refuse_a_line(cls, points: dict[str, Vector3] | None) -> dict[str, Vector3] | None:
        if points is None:
            return None
        places = list(points.values())
        apart = [tuple(a - b for a, b in zip(place, places[0], strict=True)) for place in places]
        if len(points) < 3 or not any(_sine2(a, b) > 1e-6 for a in apart for b in apart):
            raise ValueError("three points are needed that are not on one line [REL, (9)-(12)]")
        if len(set(places)) < len(places):
            raise ValueError("two points are at one place, so that nothing lies between them")
        return points


def _sine2(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Return the squared sine between two vectors, 0 where one has no length."""
    a2, b2 = sum(x * x for x in a), sum(x * x for x in b)
    dot = sum(x * y for x, y in zip(a, b, strict=True))
    return 1.0 - dot * dot / (a2 * b2) if a2 * b2 > 0.0 else 0.0
