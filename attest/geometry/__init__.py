"""Rotations: quaternions by array, SO(3) by scalar kernel, and Wahba's algebra of vectors."""
