"""Kernels are compiled when they are called, and numba is not imported before."""

import subprocess
import sys

import pytest

from attest.geometry.jit import kernel


@kernel
def half(x):
    """Halve."""
    return 0.5 * x


@kernel
def quarter(x):
    """Halve twice, by another kernel."""
    return half(half(x))


def test_a_kernel_calls_another():
    assert quarter(3.0) == 0.75
    assert (quarter.__name__, quarter.__doc__) == ("quarter", "Halve twice, by another kernel.")


@pytest.mark.parametrize("command", [["config", "show", "eso"], ["observers"]])
def test_what_runs_no_kernel_does_without_numba(sample_logs, command):
    code = (
        "import sys\nfrom attest.cli import cli\n"
        f"cli.main({command}, standalone_mode=False)\n"
        "sys.exit('numba is imported' if 'numba' in sys.modules else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=sample_logs, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
