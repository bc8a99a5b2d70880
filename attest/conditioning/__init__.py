"""From a recording to what an observer steps over.

One timeline at the gyroscope's stamps; each measured vector brought there by the gyroscope; each
known vector found for the log's place, date and motion.
"""

from attest.conditioning.calibrate import calibrate, calibrated
from attest.conditioning.condition import condition

__all__ = ["calibrate", "calibrated", "condition"]
