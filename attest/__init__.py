"""Was the attitude right? Attitude observers on SO(3) over flight logs."""

__version__ = "0.1.0"
